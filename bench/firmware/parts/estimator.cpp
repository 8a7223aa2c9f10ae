// The estimator in floats.
#include "tm485/motion/estimator.hpp"

using namespace tm485;

extern "C" {
void part_isr_estimator_update(Estimator& estimator, const Sample& sample) { estimator.update(sample); }
void part_isr_estimator_at(const Estimator& estimator, const Time& time, Estimate& to) {
  to = estimator.at(time);
}
}
