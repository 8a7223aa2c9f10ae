#include "eeprom_journal.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "plain_text.hpp"
#include "safe_file.hpp"

namespace tm485::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kFormat = "tm485-eeprom-journal";
constexpr int kVersion = 1;
constexpr std::size_t kLargestFile = 131'072;
constexpr std::size_t kLongestPath = 4'096;

Problem bad_journal(const std::string& path, std::string_view why) {
  return usage_problem("bad_journal", fmt::format("'{}' is no journal of a restore: {}", path, why),
                       "name another journal with --journal, or move this file away");
}

std::optional<JournalState> state_of(const Json& json) {
  for (const JournalState state : {JournalState::unfinished, JournalState::restored, JournalState::undone})
    if (json == Json(name(state))) return state;
  return std::nullopt;
}

/// Deeper than any journal: a file that nests for ever must not use up the stack.
Json parse_shallow(const std::string& text) {
  constexpr int kDeepest = 8;
  return Json::parse(text, [](int depth, Json::parse_event_t, Json&) { return depth <= kDeepest; }, false);
}

std::expected<EepromImage, Problem> image_of(const Json& json, const char* key, const EepromShape& shape,
                                             const std::string& path) {
  auto image = parse_image(json.value(key, Json()).dump(), ImageFormat::json, shape,
                           fmt::format("{}: \"{}\"", path, key));
  if (!image) return std::unexpected(bad_journal(path, image.error().cause));
  return image;
}

}  // namespace

std::string_view name(JournalState state) noexcept {
  return state == JournalState::unfinished ? "unfinished"
         : state == JournalState::restored ? "restored"
                                           : "undone";
}

std::string default_journal(const std::string& file) { return file + ".journal"; }

std::string next_journal(const std::string& base, std::size_t existing) {
  return existing == 0 ? base : fmt::format("{}-{}", base, existing + 1);
}

std::expected<std::vector<JournalFile>, Problem> journals_of(const std::string& base,
                                                             const EepromShape& shape, std::size_t most) {
  std::vector<JournalFile> all;
  while (all.size() <= most) {
    std::string path = next_journal(base, all.size());
    auto journal = load_journal(path, shape);
    if (!journal) return std::unexpected(std::move(journal.error()));
    if (!*journal) return all;
    all.push_back({std::move(path), std::move(**journal)});
  }
  return std::unexpected(
      usage_problem("too_many_journals", fmt::format("there are more than {} journals of '{}'", most, base),
                    "move those of restores that need no --undo any more to another folder"));
}

namespace {
Problem no_journal(const std::string& base) {
  return usage_problem("no_journal", fmt::format("there is no journal '{}'", base),
                       "name the journal of the restore with --journal");
}
Problem nothing_to_do(const JournalFile& last) {
  return usage_problem("nothing_to_do",
                       fmt::format("'{}' says that this restore is {}", last.path, name(last.journal.state)),
                       "a new restore needs neither --resume nor --undo");
}
const JournalFile* find_unfinished(const std::vector<JournalFile>& all) {
  for (const JournalFile& one : all)
    if (one.journal.state == JournalState::unfinished) return &one;
  return nullptr;
}
}  // namespace

std::expected<JournalFile, Problem> journal_to_resume(const std::string& base,
                                                      const std::vector<JournalFile>& all) {
  if (all.empty()) return std::unexpected(no_journal(base));
  if (const JournalFile* const open = find_unfinished(all)) return *open;
  return std::unexpected(nothing_to_do(all.back()));
}

std::expected<JournalFile, Problem> journal_to_undo(const std::string& base,
                                                    const std::vector<JournalFile>& all) {
  if (all.empty()) return std::unexpected(no_journal(base));
  if (const JournalFile* const open = find_unfinished(all)) return *open;
  const JournalFile* found = nullptr;
  std::string list;
  std::size_t count = 0;
  for (const JournalFile& one : all) {
    if (one.journal.state != JournalState::restored) continue;
    found = &one;
    ++count;
    list += fmt::format("\n  {}: on {}, bytes of before from {}", one.path, one.journal.port,
                        one.journal.before.date);
  }
  if (count == 0) return std::unexpected(nothing_to_do(all.back()));
  if (count == 1) return *found;
  return std::unexpected(usage_problem(
      "which_journal",
      fmt::format("this image was restored {} times, perhaps to several encoders:{}", count, list),
      "name that of this encoder with --journal"));
}

std::expected<EepromJournal, Problem> parse_journal(const std::string& content, const EepromShape& shape,
                                                    const std::string& path) {
  const Json json = parse_shallow(content);
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
  const auto text = [&json](const char* key) {
    const Json value = json.value(key, Json());
    return value.is_string() ? plain_text(value.get<std::string>(), kLongestPath) : std::string();
  };
  return EepromJournal{*state, text("port"), text("backup_file"), std::move(*wanted), std::move(*before)};
}

std::expected<std::optional<EepromJournal>, Problem> load_journal(const std::string& path,
                                                                  const EepromShape& shape) {
  std::error_code error;
  if (!std::filesystem::exists(std::filesystem::symlink_status(path, error))) return std::nullopt;
  const auto content = read_whole_file(path, kLargestFile, Links::refuse);
  if (!content) return std::unexpected(content.error());
  return parse_journal(*content, shape, path);
}

std::string journal_text(const EepromJournal& journal) {
  Json json;
  json["format"] = kFormat;
  json["version"] = kVersion;
  json["state"] = name(journal.state);
  json["port"] = journal.port;
  json["backup_file"] = journal.backup_file;
  json["wanted"] = Json::parse(image_text(journal.wanted, ImageFormat::json));
  json["before"] = Json::parse(image_text(journal.before, ImageFormat::json));
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

std::expected<std::string, Problem> create_journal(const std::string& base, const EepromJournal& journal) {
  const std::string text = journal_text(journal);
  for (std::size_t existing = 0;; ++existing) {
    std::string path = next_journal(base, existing);
    auto created = create_file(path, text);
    if (created) return path;
    if (created.error().name != "file_exists" || existing == kMostJournals)
      return std::unexpected(std::move(created.error()));
  }
}

std::expected<void, Problem> save_journal(const std::string& path, const EepromJournal& journal) {
  return replace_file(path, journal_text(journal), Links::refuse);
}

}  // namespace tm485::cli
