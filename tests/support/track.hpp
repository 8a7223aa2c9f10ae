// A position tracker with its profile, fed with frames by hand.
#pragma once

#include <chrono>
#include <expected>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/motion/position_tracker.hpp"

namespace tm485::test {

/// A tracker with its profile, fed with frames by hand.
class Track {
 public:
  explicit Track(const char* name = "tm485_17", AxisConfig axis = {}) : Track(test::preset(name), axis) {}
  Track(const Profile& profile, const AxisConfig& axis)
      : profile_(compiled(profile)), tracker_(profile_, nimble(axis)) {}

  std::expected<Sample, Errc> id3(std::uint32_t abs, std::uint32_t abm, std::uint8_t sf = 0,
                                  std::uint8_t almc = 0) {
    now_ += apart;
    return feed(test::id3_reply(abs, abm, profile_.profile().enids.values[0], sf, almc), DataId::everything);
  }
  std::expected<Sample, Errc> id0(std::uint32_t abs, std::uint8_t sf = 0) {
    return feed(test::id0_reply(abs, sf), DataId::single_turn);
  }
  std::expected<Sample, Errc> feed(const Bytes& bytes, DataId id) {
    now_ += step;
    const auto reply = Reply::parse(bytes, id, profile_);
    if (!reply) return std::unexpected(reply.error());
    return tracker_.update(*reply, now_);
  }

  PositionTracker& operator*() { return tracker_; }
  PositionTracker* operator->() { return &tracker_; }
  [[nodiscard]] Time now() const { return now_; }
  Time step = us(4'900);                  ///< nearly half a revolution at the default max_speed_rpm
  Time apart = std::chrono::seconds(10);  ///< before an ID3: it may be a thousand turns away

 private:
  /// A shaft that knows no inertia, so that positions may come as the test likes: only its speed is bounded.
  static AxisConfig nimble(AxisConfig axis) {
    axis.max_acceleration_rpm_s = AxisConfig::kSteepest;
    return axis;
  }

  CompiledProfile profile_;
  PositionTracker tracker_;
  Time now_{0};
};

}  // namespace tm485::test
