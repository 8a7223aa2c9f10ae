/* The whole C interface. docs/c-interface.md begins with a program; integrations/examples/c_axis is one. */
#pragma once

#include "tm485/c/axis.h"
#include "tm485/c/base.h"
#include "tm485/c/bus.h"
#include "tm485/c/codec.h"
#include "tm485/c/eeprom.h"
#include "tm485/c/estimator.h"
#include "tm485/c/port.h"
#include "tm485/c/profile.h"
#include "tm485/c/reset.h"
#include "tm485/c/sample.h"
