#include "eeprom_journal.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "safe_file.hpp"

namespace tm485::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kFormat = "tm485-eeprom-journal";
constexpr int kVersion = 1;
constexpr std::size_t kLargestFile = 131'072;

Problem bad_journal(const std::string& path, std::string_view why) {
  return usage_problem("bad_journal", fmt::format("'{}' is no journal of a restore: {}", path, why),
                       "name the journal with --journal, or move this file away");
}

std::optional<JournalState> state_of(const Json& json) {
  for (const JournalState state : {JournalState::unfinished, JournalState::restored, JournalState::undone})
    if (json == Json(name(state))) return state;
  return std::nullopt;
}

std::expected<EepromImage, Problem> image_of(const Json& json, const char* key, const EepromShape& shape,
                                             const std::string& path) {
  return parse_image(json.value(key, Json()).dump(), ImageFormat::json, shape,
                     fmt::format("{}: \"{}\"", path, key));
}

}  // namespace

std::string_view name(JournalState state) noexcept {
  return state == JournalState::unfinished ? "unfinished"
         : state == JournalState::restored ? "restored"
                                           : "undone";
}

std::string default_journal(const std::string& file) { return file + ".journal"; }

std::expected<std::optional<EepromJournal>, Problem> load_journal(const std::string& path,
                                                                  const EepromShape& shape) {
  std::error_code error;
  if (!std::filesystem::exists(std::filesystem::symlink_status(path, error))) return std::nullopt;
  const auto content = read_whole_file(path, kLargestFile);
  if (!content) return std::unexpected(content.error());
  const Json json = Json::parse(*content, nullptr, false);
  if (!json.is_object() || json.value("format", Json()) != Json(kFormat))
    return std::unexpected(bad_journal(path, "it is not one that tm485 eeprom restore has written"));
  if (json.value("version", Json()) != Json(kVersion))
    return std::unexpected(bad_journal(path, fmt::format("its version is not {}", kVersion)));
  const auto state = state_of(json.value("state", Json()));
  if (!state) return std::unexpected(bad_journal(path, "its state is unknown"));
  auto wanted = image_of(json, "wanted", shape, path);
  if (!wanted) return std::unexpected(std::move(wanted.error()));
  auto before = image_of(json, "before", shape, path);
  if (!before) return std::unexpected(std::move(before.error()));
  const Json backup = json.value("backup_file", Json());
  return EepromJournal{*state, backup.is_string() ? backup.get<std::string>() : std::string(),
                       std::move(*wanted), std::move(*before)};
}

std::expected<void, Problem> save_journal(const std::string& path, const EepromJournal& journal) {
  Json json;
  json["format"] = kFormat;
  json["version"] = kVersion;
  json["state"] = name(journal.state);
  json["backup_file"] = journal.backup_file;
  json["wanted"] = Json::parse(image_text(journal.wanted, ImageFormat::json));
  json["before"] = Json::parse(image_text(journal.before, ImageFormat::json));
  return replace_file(path, json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n');
}

}  // namespace tm485::cli
