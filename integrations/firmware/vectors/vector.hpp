// A golden vector as this program has it: bytes, and what is to be found in them.
#pragma once

#include <cstdint>

enum class Kind : std::uint8_t { reply, request, control_field };

/// Those that the vectors name.
enum class Field : std::uint8_t { sf, abs, abm, enid, almc, adf, edf };

struct Vector {
  struct Known {
    Field field;
    std::uint32_t value;
  };
  const char* id;
  Kind kind;
  std::uint8_t bytes[11];
  std::uint8_t count;
  const char* error;  ///< the name of the one that is to be found, or "ok"
  Known known[7];
  std::uint8_t known_count;
};
