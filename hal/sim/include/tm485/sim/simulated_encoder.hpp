// Encoder, line and host port, wired together: what `sim:` stands for.
#pragma once

#include "tm485/sim/distortion.hpp"
#include "tm485/sim/encoder_model.hpp"
#include "tm485/sim/faults.hpp"
#include "tm485/sim/line.hpp"
#include "tm485/sim/sim_options.hpp"
#include "tm485/sim/sim_port.hpp"

namespace tm485::sim {

/// Not movable: its parts point at each other. One owner.
class SimulatedEncoder {
 public:
  explicit SimulatedEncoder(const SimOptions& options = {}) noexcept
      : model_{options.encoder, options.motion},
        line_{&model_, options.line},
        port_{line_, options.port},
        bit_errors_{options.request_bit_errors, options.reply_bit_errors, options.seed + 3},
        lost_characters_{options.lost_replies, 0.0, options.seed + 4},
        distortion_{{.host_bits_per_second = options.line.bits_per_second,
                     .encoder_bits_per_second = options.line.encoder_bits_per_second != 0
                                                    ? options.line.encoder_bits_per_second
                                                    : options.line.bits_per_second,
                     .swap = options.swap,
                     .glitches = options.glitches,
                     .seed = options.seed + 5}} {
    if (!options.power) model_.power_off(Time{0});
    if (distortion_.distorts()) line_.set_distortion(&distortion_);
    if (options.request_bit_errors > 0.0 || options.reply_bit_errors > 0.0) faults_.add(bit_errors_);
    if (options.lost_replies > 0.0) faults_.add(lost_characters_);
    if (!faults_.empty()) line_.set_fault_hook(&faults_);
  }
  SimulatedEncoder(const SimulatedEncoder&) = delete;
  SimulatedEncoder& operator=(const SimulatedEncoder&) = delete;

  [[nodiscard]] SimPort& port() noexcept { return port_; }
  [[nodiscard]] Line& line() noexcept { return line_; }
  [[nodiscard]] EncoderModel& model() noexcept { return model_; }

 private:
  EncoderModel model_;
  Line line_;
  SimPort port_;
  BitErrors bit_errors_;
  LostCharacters lost_characters_;
  Distortion distortion_;
  FaultChain faults_;
};

}  // namespace tm485::sim
