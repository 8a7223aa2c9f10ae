// What most sources of the command include, compiled once (option TM485_FAST_BUILD). No source includes this file: each
// includes what it needs itself. CLI11 and nlohmann-json are not here: GCC would compile what they define into every object.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>
