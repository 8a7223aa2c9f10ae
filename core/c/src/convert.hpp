// Plain data of C to the core's types and back. Every function: constant time, no side effect.
#pragma once

#include <cstdint>
#include <optional>

#include "tm485/bus/bus.hpp"
#include "tm485/bus/pattern.hpp"
#include "tm485/bus/statistics.hpp"
#include "tm485/c/base.h"
#include "tm485/c/bus.h"
#include "tm485/c/codec.h"
#include "tm485/c/estimator.h"
#include "tm485/c/profile.h"
#include "tm485/c/sample.h"
#include "tm485/errc.hpp"
#include "tm485/motion/axis_config.hpp"
#include "tm485/motion/estimator.hpp"
#include "tm485/motion/sample.hpp"
#include "tm485/protocol/frame.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/protocol/request.hpp"
#include "tm485/time.hpp"

namespace tm485::c {

[[nodiscard]] constexpr tm485_errc code(Errc error) noexcept { return static_cast<tm485_errc>(error); }
/// Of an answer without a value.
[[nodiscard]] constexpr tm485_errc code(const std::expected<void, Errc>& answer) noexcept {
  return answer ? tm485_errc{TM485_OK} : code(answer.error());
}
[[nodiscard]] constexpr bool known(tm485_errc error) noexcept { return error < kErrcCount; }

/// The values of enumerations are those of the core; base.cpp and others assert it.
template <class Enum>
[[nodiscard]] constexpr std::uint8_t value(Enum enumerator) noexcept {
  return static_cast<std::uint8_t>(enumerator);
}
[[nodiscard]] constexpr std::uint8_t flag(bool set) noexcept { return set ? 1 : 0; }

[[nodiscard]] tm485_request to_c(const Request& request) noexcept;
/// bad_argument or a parse error if its bytes are no request.
[[nodiscard]] std::expected<Request, Errc> from_c(const tm485_request& request) noexcept;
[[nodiscard]] tm485_reply to_c(const Reply& reply, const CompiledProfile& profile) noexcept;
void to_c(const Sample& sample, tm485_sample& to) noexcept;
void to_c(const Statistics& from, tm485_statistics& to) noexcept;
void to_c(const Estimate& estimate, tm485_estimate& to) noexcept;
/// The same answer in the two structures, of which either may be null.
[[nodiscard]] tm485_errc answer(const std::expected<Feasibility, CycleRefusal>& checked,
                                tm485_feasibility* feasibility, tm485_refusal* refusal) noexcept;
[[nodiscard]] tm485_errc answer(const std::expected<void, CycleRefusal>& started,
                                tm485_refusal* refusal) noexcept;

/// Nothing if a value is none: units.
[[nodiscard]] std::optional<AxisConfig> from_c(const tm485_axis_config& config) noexcept;
/// Nothing if a value is none: an ID, a phase, units, too many steps.
[[nodiscard]] std::optional<BusConfig> from_c(const tm485_bus_config& config) noexcept;

/// The gains in place: the same layout (estimator.cpp).
[[nodiscard]] inline const EstimatorGains& gains_in(const tm485_estimator_gains* gains) noexcept {
  return *reinterpret_cast<const EstimatorGains*>(gains);
}

}  // namespace tm485::c
