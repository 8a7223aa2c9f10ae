// The server in real time, over a pseudo-terminal and a unix socket. Nothing here asserts a duration.
#include "tm485/sim/server.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "ask.hpp"

namespace tm485::sim {
namespace {

namespace fs = std::filesystem;

constexpr int kPatienceMs = 5000;
constexpr int kSilenceMs = 100;

class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::string name = (fs::temp_directory_path() / "tm485-server-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  ~TemporaryDirectory() { fs::remove_all(path_); }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  [[nodiscard]] std::string file(const char* name) const { return (path_ / name).string(); }

 private:
  fs::path path_;
};

/// Runs a server in a thread for as long as it lives.
class Running {
 public:
  explicit Running(Server server) : server_{std::move(server)} {
    thread_ = std::thread{[this] { EXPECT_TRUE(server_.serve(stop_).has_value()); }};
  }
  ~Running() { join(); }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  [[nodiscard]] const std::string& path() const { return server_.path(); }
  Server& join() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    return server_;
  }

 private:
  Server server_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

class Client {
 public:
  explicit Client(int fd) : fd_{fd} { EXPECT_GE(fd, 0) << std::strerror(errno); }
  ~Client() { ::close(fd_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  static int terminal(const std::string& path) { return ::open(path.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC); }
  static int connected(const std::string& path) {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, path.data(), path.size());
    if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return fd;
    ::close(fd);
    return -1;
  }

  void send(const Bytes& bytes) const {
    EXPECT_EQ(::write(fd_, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }

  /// Up to `count` bytes; fewer if none comes for `patience_ms`.
  [[nodiscard]] Bytes receive(std::size_t count, int patience_ms = kPatienceMs) const {
    Bytes bytes;
    while (bytes.size() < count) {
      pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
      if (::poll(&waiting, 1, patience_ms) <= 0) break;
      std::array<std::uint8_t, 64> part{};
      const ssize_t got = ::read(fd_, part.data(), std::min(part.size(), count - bytes.size()));
      if (got <= 0) break;
      bytes.insert(bytes.end(), part.begin(), part.begin() + got);
    }
    return bytes;
  }

 private:
  int fd_;
};

Server pty_server(const char* options = "", const std::string& link = {}) {
  auto server = Server::open_pty(parse_sim_options(options).value(), link);
  EXPECT_TRUE(server.has_value());
  return std::move(server.value());
}

Server unix_server(const std::string& path, const char* options = "") {
  auto server = Server::open_unix(parse_sim_options(options).value(), path);
  EXPECT_TRUE(server.has_value()) << server.error().what << server.error().reason;
  return std::move(server.value());
}

const Bytes kId2Reply{0x92, 0x00, 0x11, 0x83};

TEST(PtyServer, AnswersRequests) {
  Running running{pty_server()};
  const Client client{Client::terminal(running.path())};
  for (int k = 0; k < 50; ++k) {
    client.send({0x92});
    ASSERT_EQ(client.receive(4), kId2Reply);
  }
  EXPECT_EQ(running.join().statistics().replies, 50u);
}

TEST(PtyServer, IsRawInBothDirections) {
  // 0D 0A 03 04 11 13 and others mean something to a terminal that is not raw.
  Running running{pty_server("enid=0d")};
  const Client client{Client::terminal(running.path())};
  client.send({0x92});
  EXPECT_EQ(client.receive(4), (Bytes{0x92, 0x00, 0x0D, 0x9F}));
  client.send({0x32, 0x03, 0x0A, 0x3B});
  EXPECT_EQ(client.receive(4), (Bytes{0x32, 0x03, 0x0A, 0x3B}));
}

TEST(PtyServer, SurvivesAClientThatGoes) {
  Running running{pty_server()};
  for (int k = 0; k < 3; ++k) {
    const Client client{Client::terminal(running.path())};
    client.send({0x92});
    EXPECT_EQ(client.receive(4), kId2Reply);
  }
}

TEST(PtyServer, IsSilentOnABadRequestAndAnswersTheNext) {
  Running running{pty_server()};
  const Client client{Client::terminal(running.path())};
  client.send({0x82, 0x1A, 0x1A});
  EXPECT_TRUE(client.receive(1, kSilenceMs).empty());
  client.send({0x92});
  EXPECT_EQ(client.receive(4), kId2Reply);
}

TEST(PtyServer, SurvivesAFloodOfAnyBytes) {
  Running running{pty_server()};
  const Client client{Client::terminal(running.path())};
  Bytes flood(2000);
  for (std::size_t k = 0; k < flood.size(); ++k) flood[k] = static_cast<std::uint8_t>(k * 37 + k / 256);
  client.send(flood);
  static_cast<void>(client.receive(100'000, kSilenceMs));
  client.send({0x92});
  EXPECT_EQ(client.receive(4), kId2Reply);
}

TEST(PtyServer, EchoesWhenAsked) {
  Running running{pty_server("echo")};
  const Client client{Client::terminal(running.path())};
  client.send({0x92});
  EXPECT_EQ(client.receive(5), (Bytes{0x92, 0x92, 0x00, 0x11, 0x83}));
}

TEST(PtyServer, ARequestMayArriveInPieces) {
  Running running{pty_server()};
  const Client client{Client::terminal(running.path())};
  Bytes reply;
  // The pauses are long enough for the server to see the pieces one by one. On a busy machine one of them
  // may last so long that the request counts as abandoned; then it is sent again.
  for (int attempt = 0; attempt < 20 && reply.empty(); ++attempt) {
    for (const std::uint8_t byte : Bytes{0xEA, 0x05, 0xEF}) {
      client.send({byte});
      std::this_thread::sleep_for(ms(2));
    }
    reply = client.receive(4, kSilenceMs);
  }
  EXPECT_EQ(reply, (Bytes{0xEA, 0x05, 0xFF, 0x10}));
}

TEST(PtyServer, AResetRunActs) {
  Running running{pty_server("turn=5")};
  const Client client{Client::terminal(running.path())};
  for (int k = 0; k < 10; ++k) {
    client.send({0x62});
    ASSERT_EQ(client.receive(6).size(), 6u);
  }
  EXPECT_EQ(running.join().model().statistics().resets_done, 1u);
}

/// Sends an EEPROM request until its reply is not busy, and returns that.
Bytes ask_until_done(const Client& client, const Bytes& request) {
  Bytes reply;
  for (int attempt = 0; attempt < 2000; ++attempt) {
    client.send(request);
    reply = client.receive(4);
    if (reply.size() != 4 || (reply[1] & 0x80) == 0) break;
  }
  return reply;
}

Bytes content_of(const std::string& path) {
  std::ifstream file{path, std::ios::binary};
  return Bytes{std::istreambuf_iterator<char>{file}, {}};
}

TEST(EepromFile, AMissingOneIsCreatedErased) {
  const TemporaryDirectory directory;
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(directory.file("eeprom")).has_value());
  EXPECT_EQ(content_of(directory.file("eeprom")), Bytes(889, 0xFF));
}

TEST(EepromFile, HasEveryWriteThatWasSeenComplete) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(path).has_value());
  Running running{std::move(server)};
  const Client client{Client::terminal(running.path())};
  Bytes expected(889, 0xFF);
  for (const int page : {0, 6}) {
    EXPECT_EQ(ask_until_done(client, write_request(127, page)), write_request(127, page));
    for (int address = 120; address < 127; ++address) {
      EXPECT_EQ(ask_until_done(client, write_request(address, address)), write_request(address, address));
      expected[static_cast<std::size_t>(page) * 127 + static_cast<std::size_t>(address)] =
          static_cast<std::uint8_t>(address);
    }
    // A reply that is not busy was sent after the save of the last write, or right before it: ask twice.
    EXPECT_EQ(ask_until_done(client, read_request(126)).at(2), 126);
    EXPECT_EQ(ask_until_done(client, read_request(126)).at(2), 126);
    EXPECT_EQ(content_of(path), expected);
  }
}

TEST(EepromFile, IsSavedWithoutAFurtherRequest) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(path).has_value());
  Running running{std::move(server)};
  const Client client{Client::terminal(running.path())};
  client.send(write_request(5, 0xA5));
  EXPECT_EQ(client.receive(4), write_request(5, 0xA5));
  for (int k = 0; k < kPatienceMs && content_of(path)[5] != 0xA5; ++k) std::this_thread::sleep_for(ms(1));
  EXPECT_EQ(content_of(path)[5], 0xA5);
}

TEST(EepromFile, HasNotTheWriteThatIsUnderWay) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(path).has_value());
  server.model().eeprom().write(5, 0xA5, -kNever);
  server.model().eeprom().write(6, 0x5A, std::chrono::hours{1});  // ends after this test
  Running running{std::move(server)};
  for (int k = 0; k < kPatienceMs && content_of(path)[5] != 0xA5; ++k) std::this_thread::sleep_for(ms(1));
  EXPECT_EQ(content_of(path)[5], 0xA5);
  EXPECT_EQ(content_of(path)[6], 0xFF);
}

TEST(EepromFile, AnOrderlyEndLetsTheWriteUnderWayEnd) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  Server server = pty_server("eeprom_write=3s");
  ASSERT_TRUE(server.keep_eeprom(path).has_value());
  Running running{std::move(server)};
  const Client client{Client::terminal(running.path())};
  client.send(write_request(5, 0xA5));
  EXPECT_EQ(client.receive(4), write_request(5, 0xA5));
  EXPECT_EQ(content_of(path)[5], 0xFF);
  running.join();
  EXPECT_EQ(content_of(path)[5], 0xA5);
}

TEST(EepromFile, ItsContentIsWhatTheEncoderHolds) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  std::ofstream{path, std::ios::binary} << std::string(6 * 127 - 1, 'a') << 'z';
  Server server = pty_server("eeprom_pages=6");
  ASSERT_TRUE(server.keep_eeprom(path).has_value());
  EXPECT_EQ(server.model().eeprom().read(0), 'a');
  EXPECT_EQ(server.model().eeprom().image().back(), 'z');
}

TEST(EepromFile, OfAnotherSizeIsRefusedAndLeftAlone) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  for (const std::size_t size : {0u, 762u, 888u, 890u}) {
    std::ofstream{path, std::ios::binary} << std::string(size, 'a');
    Server server = pty_server();
    const auto kept = server.keep_eeprom(path);
    ASSERT_FALSE(kept.has_value());
    EXPECT_NE(kept.error().reason.find(std::to_string(size) + " bytes"), std::string::npos);
    EXPECT_NE(kept.error().reason.find("889"), std::string::npos);
    EXPECT_EQ(content_of(path), Bytes(size, 'a'));
    EXPECT_EQ(server.model().eeprom().read(0), 0xFF);
  }
}

TEST(EepromFile, WhatIsNoFileOrCannotBeWrittenIsRefusedWithItsName) {
  const TemporaryDirectory directory;
  const std::string in_no_folder = directory.file("nowhere") + "/eeprom";
  for (const std::string& path : {directory.file("."), in_no_folder, std::string{"/dev/null"}}) {
    Server server = pty_server();
    const auto kept = server.keep_eeprom(path);
    ASSERT_FALSE(kept.has_value()) << path;
    EXPECT_NE(kept.error().what.find("EEPROM"), std::string::npos);
    EXPECT_EQ(kept.error().reason.find("regular file") != std::string::npos, path != in_no_folder);
    EXPECT_FALSE(kept.error().reason.empty());
    EXPECT_FALSE(kept.error().remedy.empty());
  }
}

TEST(EepromFile, ASaveReplacesTheFileBehindALinkAndKeepsItsMode) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  std::ofstream{path, std::ios::binary} << std::string(889, 'a');
  fs::permissions(path, fs::perms::owner_read | fs::perms::owner_write);
  fs::create_symlink(path, directory.file("link"));
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(directory.file("link")).has_value());
  EXPECT_TRUE(fs::is_symlink(directory.file("link")));
  EXPECT_EQ(fs::status(path).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_FALSE(fs::exists(path + ".new"));
}

TEST(EepromFile, AFolderThatIsGoneEndsTheServerWithAnError) {
  const TemporaryDirectory directory;
  fs::create_directory(directory.file("folder"));
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(directory.file("folder") + "/eeprom").has_value());
  fs::remove_all(directory.file("folder"));
  server.model().eeprom().write(5, 0xA5, -kNever);
  const std::atomic<bool> stop{true};
  const auto served = server.serve(stop);
  ASSERT_FALSE(served.has_value());
  EXPECT_EQ(served.error().code, ENOENT);
}

TEST(PtyServer, ItsLinkComesAndGoes) {
  const TemporaryDirectory directory;
  const std::string link = directory.file("encoder");
  {
    Running running{pty_server("", link)};
    EXPECT_EQ(running.path(), link);
    const Client client{Client::terminal(link)};
    client.send({0x92});
    EXPECT_EQ(client.receive(4), kId2Reply);
  }
  EXPECT_FALSE(fs::is_symlink(link));
}

TEST(PtyServer, ReplacesAnOldLinkToATerminal) {
  const TemporaryDirectory directory;
  const std::string link = directory.file("encoder");
  fs::create_symlink("/dev/pts/99999", link);
  const Server server = pty_server("", link);
  EXPECT_NE(fs::read_symlink(link), "/dev/pts/99999");
}

TEST(PtyServer, DoesNotReplaceAFile) {
  const TemporaryDirectory directory;
  const std::string link = directory.file("encoder");
  std::ofstream{link} << "precious";
  const auto server = Server::open_pty({}, link);
  ASSERT_FALSE(server.has_value());
  EXPECT_NE(server.error().what.find(link), std::string::npos);
  EXPECT_FALSE(server.error().remedy.empty());
  EXPECT_TRUE(fs::is_regular_file(link));
}

TEST(UnixServer, AnswersOneClientAfterTheOther) {
  const TemporaryDirectory directory;
  Running running{unix_server(directory.file("socket"))};
  for (int k = 0; k < 3; ++k) {
    const Client client{Client::connected(running.path())};
    client.send({0x92});
    EXPECT_EQ(client.receive(4), kId2Reply);
  }
  EXPECT_EQ(running.join().statistics().clients, 3u);
}

TEST(UnixServer, AClientWaitsForItsTurn) {
  const TemporaryDirectory directory;
  Running running{unix_server(directory.file("socket"))};
  auto first = std::make_unique<Client>(Client::connected(running.path()));
  first->send({0x92});
  EXPECT_EQ(first->receive(4), kId2Reply);
  const Client second{Client::connected(running.path())};
  second.send({0x92});
  EXPECT_TRUE(second.receive(1, kSilenceMs).empty());
  first.reset();
  EXPECT_EQ(second.receive(4), kId2Reply);
}

TEST(UnixServer, SurvivesAClientThatLeavesBeforeTheReply) {
  const TemporaryDirectory directory;
  Running running{unix_server(directory.file("socket"))};
  for (int k = 0; k < 20; ++k) {
    const Client client{Client::connected(running.path())};
    client.send({0x92});
  }
  const Client client{Client::connected(running.path())};
  client.send({0x92});
  EXPECT_EQ(client.receive(4), kId2Reply);
}

TEST(UnixServer, ItsSocketIsTheOwnersAndGoesAtTheEnd) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("socket");
  {
    const Server server = unix_server(path);
    struct stat status{};
    ASSERT_EQ(::lstat(path.c_str(), &status), 0);
    EXPECT_TRUE(S_ISSOCK(status.st_mode));
    EXPECT_EQ(status.st_mode & 0777u, 0600u);
  }
  EXPECT_FALSE(fs::exists(path));
}

TEST(UnixServer, DoesNotReplaceAFile) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("socket");
  std::ofstream{path} << "precious";
  const auto server = Server::open_unix({}, path);
  ASSERT_FALSE(server.has_value());
  EXPECT_NE(server.error().reason.find("not a socket"), std::string::npos);
  EXPECT_TRUE(fs::is_regular_file(path));
}

TEST(UnixServer, DoesNotTakeASocketInUse) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("socket");
  const Server server = unix_server(path);
  const auto second = Server::open_unix({}, path);
  ASSERT_FALSE(second.has_value());
  EXPECT_NE(second.error().reason.find("another process"), std::string::npos);
}

TEST(UnixServer, ReplacesASocketThatNobodyServes) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("socket");
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), path.size());
  ASSERT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ::close(fd);
  Running running{unix_server(path)};
  const Client client{Client::connected(path)};
  client.send({0x92});
  EXPECT_EQ(client.receive(4), kId2Reply);
}

TEST(UnixServer, AnErrorKeepsItsErrno) {
  const auto server = Server::open_unix({}, "/nonexistent-directory/socket");
  ASSERT_FALSE(server.has_value());
  EXPECT_EQ(server.error().code, ENOENT);
  EXPECT_FALSE(server.error().reason.empty());
}

TEST(UnixServer, AnOverlongPathIsRefused) {
  const auto server = Server::open_unix({}, "/tmp/" + std::string(200, 'x'));
  ASSERT_FALSE(server.has_value());
  EXPECT_EQ(server.error().code, 0);
}

}  // namespace
}  // namespace tm485::sim
