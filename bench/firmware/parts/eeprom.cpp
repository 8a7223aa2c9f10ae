// The EEPROM manager, driven beside a bus.
#include <span>

#include "memory_port.hpp"
#include "tm485/bus/eeprom.hpp"

using namespace tm485;

extern "C" {
bool part_eeprom_read(EepromManager& manager, unsigned first, std::uint8_t* to, std::size_t count) {
  return manager.start_read(first, {to, count}).has_value();
}
bool part_eeprom_write(EepromManager& manager, unsigned first, const std::uint8_t* from, std::size_t count) {
  return manager.start_write(first, {from, count}).has_value();
}
bool part_eeprom_verify(EepromManager& manager, unsigned first, const std::uint8_t* with, std::size_t count) {
  return manager.start_verify(first, {with, count}).has_value();
}
void part_isr_eeprom_drive(EepromManager& manager, Bus<cost::MemoryPort>& bus, const Time& now) {
  drive(manager, bus, now);
}
}
