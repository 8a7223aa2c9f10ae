// The simulated encoder behind a pseudo-terminal or a unix socket, in real time.
//
// A host program opens the path as it would open a serial device: it writes requests and reads replies. A
// reply is written once the time has passed that request, gap and reply take on the wire. T1 is not judged
// here, nor the spacing of reset runs: what the scheduling of two processes does to them says nothing about
// the host. Needs POSIX; the only part of the simulator that reads a clock.
#pragma once

#include <atomic>
#include <cstdint>
#include <expected>
#include <memory>
#include <span>
#include <string>

#include "tm485/sim/encoder_model.hpp"
#include "tm485/sim/fault_player.hpp"
#include "tm485/sim/sim_options.hpp"
#include "tm485/time.hpp"

namespace tm485::sim {

/// Why a server could not open or go on.
struct ServerError {
  std::string what;    ///< what was being done, with the path
  std::string reason;  ///< the system's text for the errno, or why the server refused
  std::string remedy;  ///< what to do about it
  int code = 0;        ///< errno; 0 if the server itself refused
};

struct ServerStatistics {
  std::uint64_t bytes_in = 0;
  std::uint64_t replies = 0;        ///< written, also those with wrong bits
  std::uint64_t bytes_dropped = 0;  ///< not written: the client does not read, or is gone
  std::uint64_t clients = 0;        ///< accepted connections; unix socket only
  std::uint64_t replies_lost = 0;   ///< by the fault plan
  std::uint64_t bits_flipped = 0;   ///< by the fault `bits` of the plan
};

class EepromFile;
class Endpoint;

/// One thread owns it. Of `SimOptions` it takes the encoder, the motion, the line's rate and echo, and the fault plan, if
/// each of its faults has a meaning without a line (FaultInfo::served; any other is refused by name); jitter, glitches
/// and swapped wires belong to the virtual line and are ignored. The plan's time begins with the server. Destruction
/// removes the link or socket that it made.
class Server {
 public:
  /// A new pseudo-terminal in raw mode. `link_path`, if not empty, becomes a symbolic link to it; an existing
  /// link to a pseudo-terminal is replaced, anything else is refused. The terminal outlives its readers.
  [[nodiscard]] static std::expected<Server, ServerError> open_pty(const SimOptions& options,
                                                                   const std::string& link_path = {});

  /// A stream socket at `path` that only the owner may open. A socket that nobody serves any more is
  /// replaced; one in use, or anything that is not a socket, is refused. One client at a time, others wait.
  [[nodiscard]] static std::expected<Server, ServerError> open_unix(const SimOptions& options,
                                                                    const std::string& path);

  Server(Server&&) noexcept;
  Server& operator=(Server&&) noexcept;
  ~Server();

  /// Keeps the EEPROM in the file `path`, so that it outlives this process: loads it, or creates it with what the model
  /// holds (FF), and from then on saves it after each write that the encoder has completed, once the reply to the last
  /// request is out. A save takes as long as the disk does; requests wait meanwhile and are answered late. The byte of
  /// a write under way when the process is killed keeps its old value. Call before `serve`. An error: the file cannot be
  /// read or written, is no regular file, or has another size; the model is then unchanged.
  [[nodiscard]] std::expected<void, ServerError> keep_eeprom(const std::string& path);

  /// What a client has to open: the link if there is one, otherwise the terminal or the socket.
  [[nodiscard]] const std::string& path() const noexcept;

  /// Serves until `stop` is true, which it notices within about 50 ms (a signal wakes it at once). Blocks;
  /// sleeps while no request is pending. Any bytes are survived. An error means that the endpoint is gone,
  /// or that the EEPROM could not be saved.
  [[nodiscard]] std::expected<void, ServerError> serve(const std::atomic<bool>& stop);

  /// Not while `serve` runs in another thread.
  [[nodiscard]] const ServerStatistics& statistics() const noexcept { return statistics_; }
  [[nodiscard]] EncoderModel& model() noexcept { return model_; }

 private:
  Server(const SimOptions& options, std::unique_ptr<Endpoint> endpoint);

  void handle(const std::uint8_t* bytes, std::size_t count, const std::atomic<bool>& stop);
  [[nodiscard]] std::expected<void, ServerError> save_eeprom(Time now);
  [[nodiscard]] int poll_ms() const;
  [[nodiscard]] std::size_t disturb_request(std::span<const std::uint8_t> sent, Time start,
                                            std::span<std::uint8_t> heard);
  [[nodiscard]] bool continues_request(Time now) const noexcept;
  void write(const std::uint8_t* bytes, std::size_t count);
  [[nodiscard]] Time now() const;
  void wait_until(Time instant, bool exactly, const std::atomic<bool>& stop) const;

  std::unique_ptr<Endpoint> endpoint_;
  std::unique_ptr<EepromFile> eeprom_file_;  // null: none
  std::uint64_t saved_generation_ = 0;
  EncoderModel model_;
  FaultPlan plan_;
  std::uint64_t plan_seed_;
  std::unique_ptr<FaultPlayer> faults_;  // from serve() on: it points at the model
  Time character_time_;
  bool echo_;
  std::int64_t epoch_ns_;  // of the monotonic clock
  Time last_seen_{0};      // when bytes were last read
  Time request_end_{0};    // when the last of them ended on the wire
  Time line_free_{0};      // when the reply to them ended
  bool last_answered_ = false;
  ServerStatistics statistics_;
};

}  // namespace tm485::sim
