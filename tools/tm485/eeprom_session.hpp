// What all EEPROM commands begin with, and the texts that they share.
#pragma once

#include <expected>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "eeprom_image.hpp"
#include "eeprom_runner.hpp"
#include "json_output.hpp"
#include "problem.hpp"
#include "session.hpp"

namespace tm485::cli {

/// An encoder that answers, and who it is.
struct EepromSession {
  std::unique_ptr<Session> session;
  std::unique_ptr<EepromRunner> runner;
  std::uint8_t enid = 0;
};
/// Opens the port and asks the encoder for its ID. Problems: those of Session::open, wait_for_startup and ask_encoder;
/// "stopped" with exit code 1.
[[nodiscard]] std::expected<EepromSession, Problem> open_eeprom(const EepromOptions& options);
/// The same on a session that was opened; it has no cycle.
[[nodiscard]] std::expected<EepromSession, Problem> open_eeprom(std::unique_ptr<Session> session);

/// How a restore comes by its encoder.
using EepromOpener = std::function<std::expected<EepromSession, Problem>(const EepromOptions&)>;
/// As run_eeprom_restore(options), on an encoder of the caller's.
int run_eeprom_restore(const EepromOptions& options, const EepromOpener& open);

/// The shape that the profile of the options has, without opening the port.
[[nodiscard]] std::expected<EepromShape, Problem> shape_of(const PortOptions& options);

/// All bytes, as an image of now.
[[nodiscard]] std::expected<EepromImage, Problem> read_image(EepromSession& encoder, std::string_view label);

/// Lines such as "page 3, address 17: wanted A5, found FF", each after a line end; of many only the first.
[[nodiscard]] std::string differences_text(const std::vector<ByteDifference>& all, std::size_t most);
[[nodiscard]] std::vector<JsonObject> differences_json(const std::vector<ByteDifference>& all);

/// What a task has left in doubt when it ended: "; page 3, address 17 was being written ...".
[[nodiscard]] std::string doubt_text(const EepromDoubt& doubt);
[[nodiscard]] JsonObject doubt_json(const EepromDoubt& doubt);

/// writes, page_selects, retries, repaired, unconfirmed_pages.
void add_totals(JsonObject& json, const EepromTotals& totals);
[[nodiscard]] std::string totals_text(const EepromTotals& totals);

/// "161.6 ms".
[[nodiscard]] std::string milliseconds_text(Time time);

}  // namespace tm485::cli
