// From reset to run() on a Cortex-M in QEMU, and semihosting, by which the program speaks and ends.
#include "start.hpp"

#include <cstdint>

extern "C" {
extern std::uint32_t data_image, data_begin, data_end, bss_begin, bss_end, stack_top;
using Function = void (*)();
extern const Function init_begin[];
extern const Function init_end[];

[[noreturn]] void reset_handler();
[[noreturn]] void fault_handler();
}

namespace {

// Arm, "Semihosting for AArch32 and AArch64": the operation in r0, its argument in r1.
constexpr std::uint32_t kWrite0 = 0x04;
constexpr std::uint32_t kExitExtended = 0x20;
constexpr std::uint32_t kApplicationExit = 0x20026;

void semihosting(std::uint32_t operation, const void* argument) {
  register std::uint32_t r0 asm("r0") = operation;
  register const void* r1 asm("r1") = argument;
  asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

[[noreturn]] void end(int code) {
  const std::uint32_t block[2] = {kApplicationExit, static_cast<std::uint32_t>(code)};
  for (;;) semihosting(kExitExtended, block);
}

constexpr int kFaulted = 100;

struct Vectors {
  void* stack;
  Function handlers[15];
};
[[gnu::section(".vectors"), gnu::used]] const Vectors kVectors{
    &stack_top,
    {reset_handler, fault_handler, fault_handler, fault_handler, fault_handler, fault_handler, nullptr,
     nullptr, nullptr, nullptr, fault_handler, fault_handler, nullptr, fault_handler, fault_handler}};

}  // namespace

namespace tm485::cost {

void say(const char* text) { semihosting(kWrite0, text); }

}  // namespace tm485::cost

void reset_handler() {
#if defined(__ARM_FP)
  // Coprocessor access control: full access to the floating-point unit.
  volatile auto& access = *reinterpret_cast<volatile std::uint32_t*>(0xE000ED88U);
  access = access | (0xFU << 20);
  asm volatile("dsb\n\tisb" ::: "memory");
#endif
  const std::uint32_t* from = &data_image;
  for (std::uint32_t* to = &data_begin; to != &data_end; ++to) *to = *from++;
  for (volatile std::uint32_t* to = &bss_begin; to != &bss_end; ++to) *to = 0;
  for (const Function* init = init_begin; init != init_end; ++init) (*init)();
  end(tm485::cost::run());
}

void fault_handler() { end(kFaulted); }
