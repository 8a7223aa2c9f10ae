// An EEPROM manager whose requests a test sees one by one, and answers by hand.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <optional>
#include <stdexcept>

#include "support/completions.hpp"
#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/bus/eeprom.hpp"

namespace tm485::test {

inline constexpr unsigned kBytes = 7 * 127;

class EepromByHand : public testing::Test {
 protected:
  /// The next request, as soon as it is due. Ends the test if there is none.
  Request ask() {
    now = std::max(now, manager->due());
    const auto request = manager->next(now);
    if (!request) throw std::runtime_error("nothing is due");
    return *request;
  }
  void answer(const Request& request, std::uint8_t adf, std::uint8_t edf, Errc why = Errc::ok) {
    const std::uint8_t cf = request.id() == DataId::eeprom_write ? 0x32 : 0xEA;
    manager->on_completion(heard(request, eeprom_reply(cf, adf, edf), profile, why), now += us(100));
  }
  /// The encoder does what it is asked.
  void obey(const Request& request) {
    if (request.id() == DataId::eeprom_write) {
      (request.address() == 127 ? page : memory.at(page * 127U + request.address())) = request.data();
      return answer(request, request.address(), request.data());
    }
    answer(request, request.address(),
           request.address() == 127 ? page : memory.at(page * 127U + request.address()));
  }
  /// Until two replies agree.
  void look_at_page() {
    for (unsigned look = 0; look < 2; ++look) {
      const Request request = ask();
      ASSERT_EQ(request.address(), 127U);
      obey(request);
    }
  }
  void fail(const Request& request) { manager->on_completion(failed(request), now += us(100)); }
  void write(unsigned at, std::uint8_t wanted) {
    byte[0] = wanted;
    ASSERT_TRUE(manager->start_write(at, byte));
  }
  [[nodiscard]] EepromError outcome() const { return manager->outcome().value_or(EepromError{Errc::busy}); }

  CompiledProfile profile = compiled("tm485_17");
  std::array<std::uint8_t, kBytes> memory{};
  std::uint8_t page = 0;
  std::array<std::uint8_t, kBytes> value{};
  std::array<bool, kBytes> known{};
  std::array<std::uint8_t, 1> byte{};
  std::optional<EepromManager> manager{std::in_place, profile};
  Time now{ms(1'000)};
};

}  // namespace tm485::test
