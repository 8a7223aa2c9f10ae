// What start.cpp gives to a program in the emulator, and wants from it.
#pragma once

namespace tm485::cost {

/// Writes to the emulator's console.
void say(const char* text);

/// The program; its answer is the emulator's exit code. 100 is that of a fault.
[[nodiscard]] int run();

}  // namespace tm485::cost
