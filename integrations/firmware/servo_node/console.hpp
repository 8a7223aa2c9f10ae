// The console: lines of text on the second UART; an answer ends with a line "ok" or "error: ...". All of it in main.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "board_uart.hpp"
#include "node.hpp"
#include "text.h"

namespace servo_node {

class Console {
 public:
  explicit Console(Node& node) noexcept;

  /// Sets the UART up and greets. False: the UART does not answer.
  [[nodiscard]] bool start() noexcept;
  /// Takes what has come in, and answers. Once `quit` was asked for: the exit code.
  [[nodiscard]] std::optional<int> step() noexcept;

 private:
  struct Command;

  [[nodiscard]] static std::span<const Command> commands() noexcept;
  void execute(const char* line) noexcept;
  void help() noexcept;
  void begin(const char* arguments) noexcept;
  void position() noexcept;
  void statistics() noexcept;
  void errors() noexcept;
  void resume() noexcept;
  void eeprom() noexcept;
  void show_eeprom(const tm485::EepromError& outcome) noexcept;
  [[nodiscard]] bool not_running() noexcept;
  [[nodiscard]] bool read_statistics(tm485::Statistics& to) noexcept;

  void put(char character) noexcept;
  Console& text(std::string_view text) noexcept;
  /// The command was refused, and why.
  Console& error(std::string_view what) noexcept;
  Console& number(std::int64_t number) noexcept;
  void named(std::string_view name, std::int64_t value) noexcept;
  void explain(tm485::Errc code) noexcept;

  Node& node_;
  BoardUart uart_;
  text_out out_;
  text_line line_{};
  std::optional<int> exit_;
  bool refused_ = false;
};

}  // namespace servo_node
