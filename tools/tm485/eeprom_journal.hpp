// EepromJournal: what a restore wants and what was there before, in one file that survives a crash at any moment. With
// it an unfinished restore is finished or taken back.
#pragma once

#include <expected>
#include <optional>
#include <string>
#include <string_view>

#include "eeprom_image.hpp"
#include "problem.hpp"

namespace tm485::cli {

/// How far it is. Written before the first byte is, and after all bytes were verified.
enum class JournalState : std::uint8_t { unfinished, restored, undone };
[[nodiscard]] std::string_view name(JournalState state) noexcept;

struct EepromJournal {
  JournalState state = JournalState::unfinished;
  std::string backup_file;  ///< the same as `before`, as a file of its own
  EepromImage wanted;
  EepromImage before;
};

/// "FILE.journal".
[[nodiscard]] std::string default_journal(const std::string& file);

/// Nothing if there is no such file. Problem: bad_journal, file_failed or those of parse_image (exit code 2).
[[nodiscard]] std::expected<std::optional<EepromJournal>, Problem> load_journal(const std::string& path,
                                                                                const EepromShape& shape);
/// Replaces it whole. Problem: file_failed (exit code 1).
[[nodiscard]] std::expected<void, Problem> save_journal(const std::string& path,
                                                        const EepromJournal& journal);

}  // namespace tm485::cli
