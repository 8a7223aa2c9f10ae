// The list of the checks, and the test that runs them.
#include "conformance/port_conformance.hpp"

#include <array>
#include <stdexcept>
#include <string_view>

#include "conformance/play.hpp"

namespace tm485::test {
namespace {

using namespace conformance;

constexpr std::array kChecks{
    Check{"capability_is_a_constant", capability_is_a_constant},
    Check{"a_fresh_port_is_idle", a_fresh_port_is_idle},
    Check{"sends_the_request_and_nothing_else", sends_the_request_and_nothing_else},
    Check{"sent_means_off_the_line", sent_means_off_the_line},
    Check{"a_request_is_one_gapless_burst", a_request_is_one_gapless_burst},
    Check{"the_start_is_that_of_the_start_bit", the_start_is_that_of_the_start_bit},
    Check{"an_empty_request_is_refused", an_empty_request_is_refused},
    Check{"requests_follow_one_another", requests_follow_one_another},
    Check{"a_request_under_way_is_not_disturbed", a_request_under_way_is_not_disturbed},
    Check{"bytes_come_once_and_in_order", bytes_come_once_and_in_order},
    Check{"a_late_reader_loses_nothing", a_late_reader_loses_nothing},
    Check{"an_empty_buffer_takes_nothing", an_empty_buffer_takes_nothing},
    Check{"every_byte_value_passes", every_byte_value_passes},
    Check{"no_byte_is_lost_in_short_cycles", no_byte_is_lost_in_short_cycles},
    Check{"a_character_without_a_stop_bit_is_told", a_character_without_a_stop_bit_is_told},
    Check{"lost_bytes_are_told", lost_bytes_are_told},
    Check{"a_port_that_is_gone_says_so", a_port_that_is_gone_says_so},
};

}  // namespace

std::span<const Check> port_checks() { return kChecks; }

const Check& port_check(std::string_view name) {
  for (const Check& check : kChecks)
    if (check.name == name) return check;
  throw std::invalid_argument("no check of this name");
}

Violations run_check(const Check& check, Rig& rig) {
  Violations violations = check.run(rig);
  for (const std::string& complaint : rig.complaints()) violations.push_back(complaint);
  return violations;
}

TEST_P(PortConformance, Holds) {
  const auto& [port, check] = GetParam();
  const std::unique_ptr<Rig> rig = port.make();
  ASSERT_NE(rig, nullptr);
  for (const std::string& violation : run_check(check, *rig)) ADD_FAILURE() << violation;
}

}  // namespace tm485::test
