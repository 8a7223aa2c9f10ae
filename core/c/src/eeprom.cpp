// EEPROM tasks.
#include "tm485/c/eeprom.h"

#include <cstddef>
#include <cstdint>
#include <new>
#include <type_traits>

#include "convert.hpp"
#include "handles.hpp"
#include "tm485/bus/eeprom.hpp"

namespace tm485::c {
namespace {

static_assert(kFits<tm485_eeprom, EepromManager>);
static_assert(std::has_unique_object_representations_v<tm485_eeprom_outcome> &&
              std::has_unique_object_representations_v<tm485_eeprom_progress> &&
              std::has_unique_object_representations_v<tm485_eeprom_doubt>);
static_assert(sizeof(bool) == 1);

EepromManager& manager_in(tm485_eeprom* eeprom) noexcept { return object_in<EepromManager>(eeprom); }
const EepromManager& manager_in(const tm485_eeprom* eeprom) noexcept {
  return object_in<EepromManager>(eeprom);
}

}  // namespace
}  // namespace tm485::c

using namespace tm485::c;
using tm485::Time;

size_t tm485_eeprom_size(void) { return sizeof(tm485::EepromManager); }

tm485_errc tm485_eeprom_init(tm485_eeprom* eeprom, const tm485_profile* profile, uint8_t* value, bool* known,
                             size_t count) {
  if (eeprom == nullptr || profile == nullptr || !aligned(eeprom)) return TM485_ERR_BAD_ARGUMENT;
  const tm485::Profile& about = profile_in(profile).profile();
  const bool with = value != nullptr && known != nullptr;
  if (with ? count != std::size_t{about.eeprom_pages} * about.eeprom_page_bytes
           : value != nullptr || known != nullptr || count != 0)
    return TM485_ERR_BAD_ARGUMENT;
  ::new (static_cast<void*>(eeprom->storage))
      tm485::EepromManager(profile_in(profile), {.value = {value, count}, .known = {known, count}});
  return TM485_OK;
}

uint32_t tm485_eeprom_bytes(const tm485_eeprom* eeprom) { return manager_in(eeprom).size(); }

tm485_errc tm485_eeprom_linear(const tm485_eeprom* eeprom, unsigned page, unsigned address,
                               uint32_t* linear) {
  const auto found = manager_in(eeprom).linear(page, address);
  if (!found) return code(found.error());
  *linear = *found;
  return TM485_OK;
}

tm485_errc tm485_eeprom_start_read(tm485_eeprom* eeprom, uint32_t first, uint8_t* to, size_t count) {
  return code(manager_in(eeprom).start_read(first, {to, count}));
}

tm485_errc tm485_eeprom_start_write(tm485_eeprom* eeprom, uint32_t first, const uint8_t* from, size_t count) {
  return code(manager_in(eeprom).start_write(first, {from, count}));
}

tm485_errc tm485_eeprom_start_verify(tm485_eeprom* eeprom, uint32_t first, const uint8_t* with,
                                     size_t count) {
  return code(manager_in(eeprom).start_verify(first, {with, count}));
}

void tm485_eeprom_cancel(tm485_eeprom* eeprom) { manager_in(eeprom).cancel(); }

tm485_time tm485_eeprom_drive(tm485_eeprom* eeprom, tm485_bus* bus, tm485_time now) {
  return tm485::drive(manager_in(eeprom), bus_in(bus), Time{now}).count();
}

bool tm485_eeprom_active(const tm485_eeprom* eeprom) { return manager_in(eeprom).active(); }

bool tm485_eeprom_get_outcome(const tm485_eeprom* eeprom, tm485_eeprom_outcome* outcome) {
  const auto& ended = manager_in(eeprom).outcome();
  if (!ended) return false;
  *outcome = {.code = code(ended->code),
              .page = ended->page,
              .address = ended->address,
              .wanted = ended->wanted,
              .found = ended->found};
  return true;
}

void tm485_eeprom_get_progress(const tm485_eeprom* eeprom, tm485_eeprom_progress* progress) {
  const tm485::EepromProgress& so_far = manager_in(eeprom).progress();
  *progress = {.done = so_far.done,
               .total = so_far.total,
               .writes = so_far.writes,
               .page_selects = so_far.page_selects,
               .retries = so_far.retries,
               .repaired = so_far.repaired,
               .mismatches = so_far.mismatches,
               .unconfirmed_pages = so_far.unconfirmed_pages};
}

tm485_time tm485_eeprom_time_left(const tm485_eeprom* eeprom) {
  return manager_in(eeprom).time_left().count();
}

bool tm485_eeprom_in_doubt(const tm485_eeprom* eeprom, tm485_eeprom_doubt* doubt) {
  const auto left = manager_in(eeprom).in_doubt();
  if (!left) return false;
  *doubt = {.pages = left->pages, .page = left->page, .address = left->address, .reserved = {}};
  return true;
}
