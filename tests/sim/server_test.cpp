// The server in real time, over a pseudo-terminal and a unix socket. Nothing here asserts a duration.
#include "tm485/sim/server.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <termios.h>

#include <fstream>

#include "running_server.hpp"

namespace tm485::sim {
namespace {

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

TEST(PtyServer, LosesReplies) {
  Running running{pty_server("lost=1")};
  {
    const Client client{Client::terminal(running.path())};
    client.send({0x92});
    EXPECT_TRUE(client.receive(1, kSilenceMs).empty());
  }
  const ServerStatistics& counted = running.join().statistics();
  EXPECT_EQ(counted.replies_lost, 1u);
  EXPECT_EQ(counted.replies, 0u);
}

TEST(PtyServer, FlipsBitsOfReplies) {
  Running running{pty_server("ber=0:1")};
  {
    const Client client{Client::terminal(running.path())};
    client.send({0x92});
    EXPECT_EQ(client.receive(4), (Bytes{0x6D, 0xFF, 0xEE, 0x7C}));
  }
  EXPECT_EQ(running.join().statistics().bits_flipped, 32u);
}

/// The encoder does not know what it is asked for; the echo is what was sent.
TEST(PtyServer, FlipsBitsOfRequests) {
  Running running{pty_server("ber=1:0,echo=on")};
  const Client client{Client::terminal(running.path())};
  client.send({0x92});
  EXPECT_EQ(client.receive(2, kSilenceMs), Bytes{0x92});
}

TEST(PtyServer, PlaysAFaultPlan) {
  Running running{
      pty_server("plan=lose replies=1 cycles=1..1; stuck column=2 value=1 cycles=2..2; echo cycles=3..3")};
  const Client client{Client::terminal(running.path())};
  client.send({0x92});
  EXPECT_EQ(client.receive(4), kId2Reply);
  client.send({0x92});
  EXPECT_TRUE(client.receive(1, kSilenceMs).empty());
  client.send({0x92});
  EXPECT_EQ(client.receive(4), (Bytes{0x96, 0x04, 0x15, 0x87}));
  client.send({0x92});
  EXPECT_EQ(client.receive(5), (Bytes{0x92, 0x92, 0x00, 0x11, 0x83}));
}

TEST(PtyServer, RefusesFaultsOfALineByName) {
  const auto server = Server::open_pty(*parse_sim_options("plan=bits replies=1e-9; talker every=1ms"));
  ASSERT_FALSE(server.has_value());
  EXPECT_NE(server.error().reason.find("'talker'"), std::string::npos);
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

TEST(PtyServer, DoesNotTakeTheLinkOfAnother) {
  const TemporaryDirectory directory;
  const std::string link = directory.file("encoder");
  Running first{pty_server("", link)};
  const fs::path terminal = fs::read_symlink(link);
  {
    const auto second = Server::open_pty({}, link);
    ASSERT_FALSE(second.has_value());
    EXPECT_NE(second.error().what.find(link), std::string::npos);
    EXPECT_FALSE(second.error().remedy.empty());
  }
  EXPECT_EQ(fs::read_symlink(link), terminal);
  const Client client{Client::terminal(link)};
  client.send({0x92});
  EXPECT_EQ(client.receive(4), kId2Reply);
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
