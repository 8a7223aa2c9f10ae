// Encoder, line and host port, wired together: what `sim:` stands for.
#pragma once

#include "tm485/sim/distortion.hpp"
#include "tm485/sim/encoder_model.hpp"
#include "tm485/sim/fault_player.hpp"
#include "tm485/sim/line.hpp"
#include "tm485/sim/sim_options.hpp"
#include "tm485/sim/sim_port.hpp"

namespace tm485::sim {

/// Not movable: its parts point at each other. One owner.
class SimulatedEncoder {
 public:
  explicit SimulatedEncoder(const SimOptions& options = {})
      : model_{options.encoder, options.motion},
        line_{&model_, options.line},
        port_{line_, options.port},
        distortion_{{.host_bits_per_second = options.line.bits_per_second,
                     .encoder_bits_per_second = options.line.encoder_bits_per_second != 0
                                                    ? options.line.encoder_bits_per_second
                                                    : options.line.bits_per_second,
                     .swap = options.swap,
                     .glitches = options.glitches,
                     .seed = options.seed + 5}},
        faults_{fault_plan_of(options), options.seed + 6, stage()} {
    if (!options.power) model_.power_off(Time{0});
    if (distortion_.distorts()) line_.set_distortion(&distortion_);
    if (!faults_.empty()) line_.set_fault_hook(&faults_);
  }
  SimulatedEncoder(const SimulatedEncoder&) = delete;
  SimulatedEncoder& operator=(const SimulatedEncoder&) = delete;

  [[nodiscard]] SimPort& port() noexcept { return port_; }
  [[nodiscard]] Line& line() noexcept { return line_; }
  [[nodiscard]] EncoderModel& model() noexcept { return model_; }
  /// The fault plan in action.
  [[nodiscard]] FaultPlayer& faults() noexcept { return faults_; }

 private:
  [[nodiscard]] FaultPlayer::Stage stage() noexcept {
    return {.encoder = &model_,
            .line = &line_,
            .distortion = &distortion_,
            .character_time = line_.character_time()};
  }

  EncoderModel model_;
  Line line_;
  SimPort port_;
  Distortion distortion_;
  FaultPlayer faults_;
};

}  // namespace tm485::sim
