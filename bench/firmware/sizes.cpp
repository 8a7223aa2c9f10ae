// How much RAM the core's types take: each symbol is as big as the type it is named after. Never linked; report.py
// reads the sizes from the object, so none is written down by hand.
#include <cstddef>

#include "memory_port.hpp"
#include "tm485/bus/axis.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/bus/eeprom.hpp"
#include "tm485/motion/estimator.hpp"
#include "tm485/motion/estimator_fixed.hpp"

namespace tm485::cost {

template <class T>
struct As {
  std::byte bytes[sizeof(T)];
};

extern "C" {
As<Scheduler> ram_scheduler{};
As<RequestSpacing> ram_request_spacing{};
As<PositionTracker> ram_position{};
As<Statistics> ram_statistics{};
As<Exchange> ram_exchange{};
As<Startup> ram_startup{};
As<BackgroundQueue> ram_background{};
As<BusConfig> ram_bus_config{};
As<LatestValue<Sample>> ram_latest_value{};
As<Bus<MemoryPort>> ram_bus{};
As<Axis<MemoryPort>> ram_axis{};
As<EepromManager> ram_eeprom{};
As<Estimator> ram_estimator{};
As<FixedEstimator> ram_fixed_estimator{};
As<CompiledProfile> flash_profile{};
}

}  // namespace tm485::cost
