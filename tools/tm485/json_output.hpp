// JsonObject: one JSON object, its keys in the order of the calls. Keeps the JSON library out of every other file.
#pragma once

#include <concepts>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace tm485::cli {

class JsonObject {
 public:
  JsonObject();
  ~JsonObject();
  JsonObject(JsonObject&&) noexcept;
  JsonObject& operator=(JsonObject&&) noexcept;

  /// Integers become JSON integers, double a JSON number (null if it is not finite).
  template <std::integral T>
    requires(!std::same_as<T, bool>)
  JsonObject& set(std::string_view key, T value) {
    if constexpr (std::signed_integral<T>)
      return set_signed(key, value);
    else
      return set_unsigned(key, value);
  }
  JsonObject& set(std::string_view key, double value);
  JsonObject& set(std::string_view key, std::same_as<bool> auto value) { return set_bool(key, value); }
  JsonObject& set(std::string_view key, std::string_view value);
  JsonObject& set(std::string_view key, const char* value) { return set(key, std::string_view(value)); }
  JsonObject& set(std::string_view key, const std::vector<std::string_view>& values);
  JsonObject& set(std::string_view key, const std::vector<unsigned>& values);
  JsonObject& set(std::string_view key, const std::vector<std::int64_t>& values);
  JsonObject& set(std::string_view key, JsonObject value);
  JsonObject& set(std::string_view key, std::vector<JsonObject> values);

  /// The object on one line, without a line end. Text that is not UTF-8 is made so.
  [[nodiscard]] std::string text() const;

 private:
  JsonObject& set_signed(std::string_view key, std::int64_t value);
  JsonObject& set_unsigned(std::string_view key, std::uint64_t value);
  JsonObject& set_bool(std::string_view key, bool value);

  struct Value;
  std::unique_ptr<Value> value_;
};

}  // namespace tm485::cli
