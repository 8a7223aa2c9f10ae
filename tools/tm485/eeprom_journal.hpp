// EepromJournal: what a restore wants and what was there before, in one file that survives a crash at any moment. With
// it an unfinished restore is finished or taken back.
#pragma once

#include <cstddef>
#include <expected>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "eeprom_image.hpp"
#include "problem.hpp"

namespace tm485::cli {

/// How far it is. Written before the first byte is, and after all bytes were verified.
enum class JournalState : std::uint8_t { unfinished, restored, undone };
[[nodiscard]] std::string_view name(JournalState state) noexcept;

struct EepromJournal {
  JournalState state = JournalState::unfinished;
  std::string port;         ///< as typed, for people: which of several encoders it was
  std::string backup_file;  ///< the same as `before`, as a file of its own
  EepromImage wanted;
  EepromImage before;
};

/// "FILE.journal".
[[nodiscard]] std::string default_journal(const std::string& file);

/// One image may be restored to many encoders, and each has its own bytes to go back to. So a journal is never replaced
/// by that of another restore: they are BASE, BASE-2, BASE-3 ...
struct JournalFile {
  std::string path;
  EepromJournal journal;
};
inline constexpr std::size_t kMostJournals = 10'000;  ///< of one image
/// Those that there are. Problem: that of load_journal; too_many_journals (exit code 2).
[[nodiscard]] std::expected<std::vector<JournalFile>, Problem> journals_of(const std::string& base,
                                                                           const EepromShape& shape,
                                                                           std::size_t most = kMostJournals);
/// The name for one more.
[[nodiscard]] std::string next_journal(const std::string& base, std::size_t existing);
/// The one that --resume goes on with: unfinished. Problems, exit code 2: no_journal, nothing_to_do.
[[nodiscard]] std::expected<JournalFile, Problem> journal_to_resume(const std::string& base,
                                                                    const std::vector<JournalFile>& all);
/// The one that --undo takes back: unfinished, or else the only one that is not undone. Problems, exit code 2: no_journal,
/// nothing_to_do, which_journal.
[[nodiscard]] std::expected<JournalFile, Problem> journal_to_undo(const std::string& base,
                                                                  const std::vector<JournalFile>& all);

/// The journal in the content of a file, and the other way round. Problem: bad_journal (exit code 2); `path` is for the
/// texts.
[[nodiscard]] std::expected<EepromJournal, Problem> parse_journal(const std::string& content,
                                                                  const EepromShape& shape,
                                                                  const std::string& path);
[[nodiscard]] std::string journal_text(const EepromJournal& journal);

/// Nothing if there is no such file. Problem: bad_journal, file_failed or those of parse_image (exit code 2).
[[nodiscard]] std::expected<std::optional<EepromJournal>, Problem> load_journal(const std::string& path,
                                                                                const EepromShape& shape);
/// As a new file, under the first name that is free; answers it. Problem: file_failed (exit code 1).
[[nodiscard]] std::expected<std::string, Problem> create_journal(const std::string& base,
                                                                 const EepromJournal& journal);
/// Replaces it whole. Problem: file_failed (exit code 1).
[[nodiscard]] std::expected<void, Problem> save_journal(const std::string& path,
                                                        const EepromJournal& journal);

}  // namespace tm485::cli
