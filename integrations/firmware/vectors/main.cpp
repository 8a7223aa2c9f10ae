// vectors: the golden vectors of tests/vectors, decoded on the core itself. Names those that fail; the exit code is 1 then.
#include "vectors.hpp"

#include <span>
#include <string_view>

#include "semihosting.h"
#include "text.h"
#include "tm485/protocol/control_field.hpp"
#include "tm485/protocol/crc.hpp"
#include "tm485/protocol/frame.hpp"
#include "tm485/protocol/request.hpp"

namespace {

using tm485::Errc;

std::uint32_t field_of(const tm485::Frame& frame, Field field) noexcept {
  switch (field) {
    case Field::sf:
      return frame.sf();
    case Field::abs:
      return frame.abs();
    case Field::abm:
      return frame.abm();
    case Field::enid:
      return frame.enid();
    case Field::almc:
      return frame.almc();
    case Field::adf:
      return frame.adf();
    case Field::edf:
      return frame.edf();
  }
  return ~std::uint32_t{0};
}

std::uint32_t field_of(const tm485::Request& request, Field field) noexcept {
  return field == Field::adf ? request.address() : field == Field::edf ? request.data() : ~std::uint32_t{0};
}

/// True if what was parsed, or why it was not, is what the vector says.
template <class T>
bool holds(const std::expected<T, Errc>& parsed, const Vector& vector) noexcept {
  if (!parsed) return tm485::name(parsed.error()) == vector.error;
  if (std::string_view(vector.error) != "ok") return false;
  for (const Vector::Known& known : std::span(vector.known).first(vector.known_count))
    if (field_of(*parsed, known.field) != known.value) return false;
  return true;
}

bool holds(const Vector& vector) noexcept {
  const std::span<const std::uint8_t> bytes = std::span(vector.bytes).first(vector.count);
  switch (vector.kind) {
    case Kind::reply:
      return holds(tm485::Frame::parse(bytes), vector);
    case Kind::request:
      return holds(tm485::Request::parse(bytes), vector);
    case Kind::control_field: {
      const auto id = tm485::parse_control_field(bytes[0]);
      return id && tm485::control_field(*id) == bytes[0];
    }
  }
  return false;
}

}  // namespace

// Nothing here is switched on.
extern "C" void on_bus_timer() {}
extern "C" void on_control() {}
extern "C" void on_encoder_uart() {}

int main() {
  const text_out out{[](void*, char character) {
                       const char text[2] = {character, '\0'};
                       host_print(text);
                     },
                     nullptr};
  std::uint32_t failed = 0;
  for (const Vector& vector : kVectors) {
    if (holds(vector)) continue;
    ++failed;
    put_text(&out, vector.id);
    put_text(&out, " failed\n");
  }
  put_number(&out, static_cast<std::int64_t>(std::size(kVectors)));
  put_text(&out, " vectors, ");
  put_number(&out, failed);
  put_text(&out, " failed\n");
  return failed == 0 ? 0 : 1;
}
