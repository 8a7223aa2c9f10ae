// Good rigs that other tests build upon.
#pragma once

#include <memory>

#include "conformance/port_conformance.hpp"

namespace tm485::test {

/// SimPort on a simulated line.
[[nodiscard]] std::unique_ptr<Rig> make_sim_rig();
/// PolledUartPort on a model of a PL011, with a driver pin that is judged.
[[nodiscard]] std::unique_ptr<Rig> make_pl011_rig();
/// SerialPort on a pseudo-terminal.
[[nodiscard]] std::unique_ptr<Rig> make_pseudo_terminal_rig();

}  // namespace tm485::test
