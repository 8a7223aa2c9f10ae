// The register driver of this board's UARTs.
#pragma once

#include "tm485/mcu/cmsdk_uart.hpp"
#include "tm485/mcu/register_access.hpp"

using BoardUart = tm485::mcu::CmsdkUart<tm485::mcu::VolatileRegisters>;
