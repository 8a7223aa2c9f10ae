// What lies in the storage of a handle, and the port that calls the user's functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <new>
#include <span>

#include "tm485/bus/axis.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/c/axis.h"
#include "tm485/c/bus.h"
#include "tm485/c/port.h"
#include "tm485/c/profile.h"
#include "tm485/errc.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/time.hpp"

namespace tm485::c {

/// A table of C functions as a Port. What they answer is not trusted: it must not lead beyond a buffer or a table.
class CPort {
 public:
  explicit CPort(const tm485_port& port) noexcept : port_(&port) {}

  [[nodiscard]] PortCapability capability() const noexcept;
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept;
  [[nodiscard]] Transmission transmission(Time now) noexcept;
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept;

 private:
  const tm485_port* port_;
};
static_assert(Port<CPort>);

using CBus = Bus<CPort>;
using CAxis = Axis<CPort>;

/// Whom the user wants told, with the user's own type of time.
struct InvalidHook {
  void (*call)(void* context, tm485_time now) = nullptr;
  void* context = nullptr;

  static void forward(void* hook, Time now) noexcept {
    const auto& self = *static_cast<const InvalidHook*>(hook);
    self.call(self.context, now.count());
  }
};

/// What lies in the storage of a bus. The object is first, so that a handle's address is that of the object, also of
/// the bus within an axis. The port is made before it: the object asks it at once.
struct BusContent {
  alignas(CBus) unsigned char object[sizeof(CBus)];
  alignas(CPort) unsigned char port[sizeof(CPort)];
};
struct AxisContent {
  alignas(CAxis) unsigned char object[sizeof(CAxis)];
  alignas(CPort) unsigned char port[sizeof(CPort)];
  alignas(InvalidHook) unsigned char hook[sizeof(InvalidHook)];
};

/// Storage that a header promises: enough, aligned, and not wastefully more.
template <class Handle, class Content>
inline constexpr bool kFits = sizeof(Content) <= sizeof(Handle) && alignof(Content) <= alignof(Handle) &&
                              sizeof(Handle) * 4 <= sizeof(Content) * 5;

template <class Handle>
[[nodiscard]] bool aligned(const Handle* handle) noexcept {
  return reinterpret_cast<std::uintptr_t>(handle) % alignof(Handle) == 0;
}

/// The object in a handle's storage.
template <class Object, class Handle>
[[nodiscard]] Object& object_in(Handle* handle) noexcept {
  return *std::launder(reinterpret_cast<Object*>(handle));
}
template <class Object, class Handle>
[[nodiscard]] const Object& object_in(const Handle* handle) noexcept {
  return *std::launder(reinterpret_cast<const Object*>(handle));
}

[[nodiscard]] inline CBus& bus_in(tm485_bus* bus) noexcept { return object_in<CBus>(bus); }
[[nodiscard]] inline const CBus& bus_in(const tm485_bus* bus) noexcept { return object_in<CBus>(bus); }
[[nodiscard]] inline const CompiledProfile& profile_in(const tm485_profile* profile) noexcept {
  return object_in<CompiledProfile>(profile);
}

[[nodiscard]] inline bool complete(const tm485_port* port) noexcept {
  return port != nullptr && port->capability != nullptr && port->try_send != nullptr &&
         port->transmission != nullptr && port->try_receive != nullptr;
}

}  // namespace tm485::c

// Once for the library, in bus.cpp and axis.cpp.
extern template class tm485::Bus<tm485::c::CPort>;
extern template class tm485::Axis<tm485::c::CPort>;
