// The estimator in integers.
#include "tm485/motion/estimator_fixed.hpp"

using namespace tm485;

extern "C" {
void part_isr_fixed_estimator_update(FixedEstimator& estimator, const Sample& sample) {
  estimator.update(sample);
}
void part_isr_fixed_estimator_at(const FixedEstimator& estimator, const Time& time, FixedEstimate& to) {
  to = estimator.at(time);
}
}
