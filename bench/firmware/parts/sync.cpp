// Crossing contexts: the newest sample.
#include "tm485/motion/sample.hpp"
#include "tm485/sync/latest_value.hpp"

using namespace tm485;

extern "C" {
void part_sync_put(LatestValue<Sample>& value, const Sample& sample) { value.put(sample); }
const Sample* part_sync_get(LatestValue<Sample>& value) { return &value.get(); }
}
