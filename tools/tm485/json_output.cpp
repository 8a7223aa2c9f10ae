#include "json_output.hpp"

#include <nlohmann/json.hpp>

namespace tm485::cli {

using Json = nlohmann::ordered_json;

struct JsonObject::Value {
  Json json = Json::object();
};

JsonObject::JsonObject() : value_(std::make_unique<Value>()) {}
JsonObject::~JsonObject() = default;
JsonObject::JsonObject(JsonObject&&) noexcept = default;
JsonObject& JsonObject::operator=(JsonObject&&) noexcept = default;

JsonObject& JsonObject::set_signed(std::string_view key, std::int64_t value) {
  value_->json[std::string(key)] = value;
  return *this;
}

JsonObject& JsonObject::set_unsigned(std::string_view key, std::uint64_t value) {
  value_->json[std::string(key)] = value;
  return *this;
}

JsonObject& JsonObject::set_bool(std::string_view key, bool value) {
  value_->json[std::string(key)] = value;
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, double value) {
  value_->json[std::string(key)] = value;
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, std::string_view value) {
  value_->json[std::string(key)] = value;
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, const std::vector<std::string_view>& values) {
  value_->json[std::string(key)] = values;
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, const std::vector<unsigned>& values) {
  value_->json[std::string(key)] = values;
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, const std::vector<std::int64_t>& values) {
  value_->json[std::string(key)] = values;
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, JsonObject value) {
  value_->json[std::string(key)] = std::move(value.value_->json);
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, std::vector<JsonObject> values) {
  Json array = Json::array();
  for (JsonObject& value : values) array.push_back(std::move(value.value_->json));
  value_->json[std::string(key)] = std::move(array);
  return *this;
}

std::string JsonObject::text() const {
  return value_->json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace tm485::cli
