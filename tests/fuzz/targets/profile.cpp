// Profile files: any text is refused with a line, or makes a profile that the core's own check accepts.
#include <string>

#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"
#include "profile_toml.hpp"

namespace tm485::fuzz {

int fuzz_profile(std::span<const std::uint8_t> bytes) {
  Input input(bytes);
  const auto compiled = cli::profile_from_toml(input.text(), "x.toml");
  if (!compiled) {
    require(compiled.error().cause.starts_with("x.toml:"), "a refusal names the line");
    return 0;
  }
  const Profile& p = compiled->profile();
  require(p.single_turn_bits >= 8 && p.single_turn_bits <= 24, "width");
  require(p.t2_min <= p.t2_max && p.t2_min >= Time{0}, "T2 window");
  for (const DataId id : kDataIds) {
    require(p.t1[index_of(id)] >= Time{0} && p.t1[index_of(id)] <= std::chrono::seconds(60), "T1");
    require(compiled->exchange_max(id) > Time{0}, "an exchange takes time");
  }
  require(CompiledProfile::compile(p).has_value(), "it compiles again");
  require(p.name.size() <= 256, "the name is no book");
  return 0;
}

}  // namespace tm485::fuzz
