// Loads the golden vectors.
#pragma once

#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/frames.hpp"

namespace tm485::test {

struct Vector {
  std::string id;  ///< its own name, or its bytes
  std::string kind;
  std::string direction;  ///< "host->encoder", "encoder->host", or empty
  Bytes bytes;
  nlohmann::json decoded;

  /// A decoded number, which the two files write as a number or as a hexadecimal string.
  [[nodiscard]] std::optional<std::uint32_t> field(const char* key) const {
    if (!decoded.contains(key)) return std::nullopt;
    const auto& value = decoded.at(key);
    if (value.is_number()) return value.get<std::uint32_t>();
    return static_cast<std::uint32_t>(std::stoul(value.get<std::string>(), nullptr, 16));
  }
};

inline Bytes from_hex(const std::string& text) {
  Bytes bytes;
  std::istringstream in(text);
  for (std::string word; in >> word;)
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(word, nullptr, 16)));
  return bytes;
}

inline std::vector<Vector> load_vectors(const std::string& file) {
  std::ifstream in(std::string(TM485_TEST_VECTORS) + "/" + file);
  if (!in) throw std::runtime_error("cannot open " + file);
  std::vector<Vector> vectors;
  const nlohmann::json document = nlohmann::json::parse(in);
  for (const auto& entry : document.at("vectors")) {
    Vector vector;
    const std::string hex = entry.at("hex").get<std::string>();
    vector.id = entry.value("id", hex);
    vector.kind = entry.at("kind").get<std::string>();
    vector.direction = entry.value("direction", "");
    vector.bytes = from_hex(hex);
    vector.decoded = entry.at("decoded");
    vectors.push_back(vector);
  }
  return vectors;
}

}  // namespace tm485::test
