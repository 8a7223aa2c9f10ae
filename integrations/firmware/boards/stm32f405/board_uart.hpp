// The register driver of this board's UARTs.
#pragma once

#include "tm485/mcu/register_access.hpp"
#include "tm485/mcu/stm32_usart_v1.hpp"

using BoardUart = tm485::mcu::Stm32UsartV1<tm485::mcu::VolatileRegisters>;
