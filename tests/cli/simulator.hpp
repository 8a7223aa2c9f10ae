// A `tm485 sim` that runs for the length of a test.
#pragma once

#include <gtest/gtest.h>

#include <csignal>
#include <string>

#include "cli/process.hpp"

namespace tm485::test {

class Simulator {
 public:
  /// `arguments` after "sim". Waits until it serves.
  explicit Simulator(Process::Arguments arguments)
      : process_(with_sim(std::move(arguments))), port_(process_.read_line()) {
    EXPECT_FALSE(port_.empty()) << "the simulator printed no path";
  }

  /// What it printed: the PORT for the other commands.
  [[nodiscard]] const std::string& port() const { return port_; }
  Process& process() { return process_; }
  /// Ends it in good order.
  [[nodiscard]] Finished stop() {
    process_.send_signal(SIGTERM);
    return process_.wait();
  }

 private:
  static Process::Arguments with_sim(Process::Arguments arguments) {
    arguments.insert(arguments.begin(), "sim");
    return arguments;
  }

  Process process_;
  std::string port_;
};

}  // namespace tm485::test
