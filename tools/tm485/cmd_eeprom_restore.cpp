// tm485 eeprom restore: writes an image so that at any moment it can be finished or taken back.
//
//   read what is there -> backup file -> journal -> write what differs -> read all of it -> journal: done

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>

#include "confirm.hpp"
#include "eeprom_journal.hpp"
#include "eeprom_session.hpp"
#include "output.hpp"
#include "safe_file.hpp"

namespace tm485::cli {
namespace {

constexpr std::size_t kShownDifferences = 8;
/// Bytes that are found wrong at the end are written again, so often.
constexpr int kRounds = 3;
/// A byte that was being written when the power failed can be anything. More of them: it is another encoder.
constexpr std::size_t kMostForeign = 16;

enum class Action : std::uint8_t { restore, resume, undo };

std::string_view name(Action action) {
  return action == Action::restore ? "restore" : action == Action::resume ? "resume" : "undo";
}

/// Everything that is said at the end, whatever the end is.
struct Account {
  std::string outcome = "failed";  ///< identical, done, stopped, failed
  std::size_t differing = 0;       ///< before the first write
  int rounds = 0;                  ///< times that all bytes were compared after a write
  Time read_time{0};
  Time write_time{0};
  Time verify_time{0};
  std::vector<ByteDifference> suspects;  ///< wrong at the end
  std::optional<EepromDoubt> doubt;      ///< was being written at the end
};

class Restore {
 public:
  Restore(const EepromOptions& options, const EepromOpener& open)
      : options_(options),
        open_(open),
        action_(options.undo     ? Action::undo
                : options.resume ? Action::resume
                                 : Action::restore),
        journal_path_(options.journal.empty() ? default_journal(options.file) : options.journal) {}

  int run() {
    auto done = prepare();
    if (done) {
      auto encoder = open_(options_);
      if (!encoder) return report(encoder.error());
      encoder_ = std::move(*encoder);
      done = carry_out();
      if (const int result = show(); result != kExitGood) return result;
    }
    return done ? kExitGood : report(done.error());
  }

 private:
  using Result = std::expected<void, Problem>;

  static std::unexpected<Problem> refused(std::string name, std::string cause, std::string remedy) {
    return std::unexpected(usage_problem(std::move(name), std::move(cause), std::move(remedy)));
  }

  /// What can be refused without the encoder.
  Result prepare() {
    if (auto can = can_confirm(options_.yes, "--yes"); !can) return can;
    const auto shape = shape_of(options_.port);
    if (!shape) return std::unexpected(shape.error());
    const auto journals = journals_of(journal_path_, *shape);
    if (!journals) return std::unexpected(journals.error());
    return action_ == Action::restore ? prepare_restore(*shape, *journals) : prepare_from(*shape, *journals);
  }

  Result prepare_restore(const EepromShape& shape, const std::vector<JournalFile>& journals) {
    for (const JournalFile& one : journals)
      if (one.journal.state == JournalState::unfinished)
        return refused(
            "unfinished_restore",
            fmt::format("'{}' says that a restore on {} was not finished", one.path, one.journal.port),
            "finish it with --resume, or take it back with --undo; another encoder needs another "
            "--journal");
    journal_base_ = journal_path_;
    journal_path_ = next_journal(journal_base_, journals.size());
    if (options_.backup == journal_path_)
      return refused("same_file", fmt::format("'{}' is to be backup and journal", journal_path_),
                     "give them different names");
    auto image = load_image(options_.file, image_format(options_.file, options_.format), shape);
    if (!image) return std::unexpected(std::move(image.error()));
    journal_.wanted = std::move(*image);
    return {};
  }

  Result prepare_from(const EepromShape& shape, const std::vector<JournalFile>& journals) {
    // One that was named is that one, and none of its numbered neighbours.
    const bool named = !options_.journal.empty() && !journals.empty();
    const std::vector<JournalFile>& among = named ? std::vector{journals.front()} : journals;
    auto found = action_ == Action::resume ? journal_to_resume(journal_path_, among)
                                           : journal_to_undo(journal_path_, among);
    if (!found) return std::unexpected(std::move(found.error()));
    journal_path_ = found->path;
    journal_ = std::move(found->journal);
    if (::access(options_.file.c_str(), F_OK) != 0) return {};
    // The journal has all that is needed; but it must be the journal of this file.
    const auto image = load_image(options_.file, image_format(options_.file, options_.format), shape);
    if (!image) return std::unexpected(image.error());
    if (image->bytes != journal_.wanted.bytes)
      return refused(
          "other_image",
          fmt::format("'{}' is the journal of another image than '{}'", journal_path_, options_.file),
          "name the file and the journal that belong together; without FILE the journal alone is enough");
    return {};
  }

  [[nodiscard]] const EepromImage& target() const {
    return action_ == Action::undo ? journal_.before : journal_.wanted;
  }
  [[nodiscard]] EepromRunner& runner() const { return *encoder_.runner; }

  Result carry_out() {
    auto present = read_image(encoder_, "reading");
    account_.read_time = runner().duration();
    if (!present) return stopped_or_failed(std::move(present.error()), false);
    const auto differing = differences(target().shape, target().bytes, present->bytes);
    account_.differing = differing.size();
    if (action_ == Action::restore && differing.empty()) {
      account_.outcome = "identical";
      return {};
    }
    if (auto same = check_encoder(*present); !same) return same;
    if (auto yes = confirm(options_.yes, question(), "yes"); !yes) {
      account_.outcome = "declined";
      return yes;
    }
    if (auto kept = keep(std::move(*present)); !kept) return kept;
    if (auto done = write_and_verify(differing); !done)
      return stopped_or_failed(std::move(done.error()), true);
    journal_.state = action_ == Action::undo ? JournalState::undone : JournalState::restored;
    if (auto saved = save_journal(journal_path_, journal_); !saved) return saved;
    account_.outcome = "done";
    return {};
  }

  /// The journal's own encoder holds, byte by byte, the old or the new.
  Result check_encoder(const EepromImage& present) const {
    if (action_ == Action::restore) {
      if (const auto enid = journal_.wanted.enid; enid && *enid != encoder_.enid)
        fmt::print(stderr, "tm485: the image is of an encoder with ENID {:02X}, this one has {:02X}\n", *enid,
                   encoder_.enid);
      return {};
    }
    std::size_t foreign = 0;
    for (std::size_t i = 0; i < present.bytes.size(); ++i)
      if (present.bytes[i] != journal_.before.bytes[i] && present.bytes[i] != journal_.wanted.bytes[i])
        ++foreign;
    if (foreign <= kMostForeign && (!journal_.before.enid || *journal_.before.enid == encoder_.enid))
      return {};
    return refused(
        "other_encoder",
        fmt::format("{}: {} bytes are neither those of before the restore nor those of the image",
                    encoder_.session->port().text(), foreign),
        fmt::format(
            "connect the encoder that the journal belongs to; to another one, restore without --resume or "
            "--undo and with another --journal. If it is this one, and it was written to since: the bytes "
            "of before are in '{}'",
            journal_.backup_file));
  }

  [[nodiscard]] std::string question() const {
    const Time write_time = encoder_.session->profile().profile().eeprom_write_time;
    const Time about = write_time * static_cast<std::int64_t>(account_.differing);
    return fmt::format("{}: write {} of {} bytes (about {:.1f} s)?", name(action_), account_.differing,
                       target().bytes.size(), std::chrono::duration<double>(about).count());
  }

  /// From here on everything can be taken back, whatever happens.
  Result keep(EepromImage present) {
    if (action_ == Action::restore) {
      journal_.backup_file = options_.backup.empty() ? backup_name(present.date) : options_.backup;
      const std::string text = image_text(
          present, options_.backup.empty() ? ImageFormat::json : image_format(options_.backup, {}));
      if (auto saved = create_file(journal_.backup_file, text); !saved) return saved;
      journal_.before = std::move(present);
    }
    journal_.state = JournalState::unfinished;
    journal_.port = encoder_.session->port().text();
    if (action_ != Action::restore) return save_journal(journal_path_, journal_);
    // Another restore may have taken the name since it was chosen.
    auto path = create_journal(journal_base_, journal_);
    if (!path) return std::unexpected(std::move(path.error()));
    journal_path_ = std::move(*path);
    return {};
  }

  /// A name that is not in use: a backup is never replaced.
  [[nodiscard]] std::string backup_name(std::string date) const {
    std::erase_if(date, [](char c) { return c == ':' || c == '-'; });
    for (int n = 1;; ++n) {
      std::string path =
          fmt::format("{}.{}{}.backup.json", options_.file, date, n == 1 ? "" : fmt::format("-{}", n));
      if (::access(path.c_str(), F_OK) != 0) return path;
    }
  }

  Result write_and_verify(std::vector<ByteDifference> wrong) {
    const EepromShape& shape = target().shape;
    for (int round = 0; round < kRounds; ++round) {
      if (!wrong.empty()) {
        const unsigned first = wrong.front().page * shape.page_bytes + wrong.front().address;
        const unsigned last = wrong.back().page * shape.page_bytes + wrong.back().address;
        auto written =
            runner().write(first, std::span(target().bytes).subspan(first, last - first + 1), "writing");
        account_.write_time += runner().duration();
        if (!written) return written;
      }
      const auto after = read_image(encoder_, "verifying");
      account_.verify_time += runner().duration();
      if (!after) return std::unexpected(after.error());
      ++account_.rounds;
      wrong = differences(shape, target().bytes, after->bytes);
      if (wrong.empty()) return {};
    }
    account_.suspects = wrong;
    return std::unexpected(Problem{"eeprom_mismatch",
                                   fmt::format("{} bytes are not as wanted:{}", wrong.size(),
                                               differences_text(wrong, kShownDifferences)),
                                   {},
                                   kExitFailure});
  }

  Result stopped_or_failed(Problem problem, bool begun) {
    if (problem.name == "stopped") account_.outcome = "stopped";
    if (const auto mismatch = runner().mismatch(); mismatch && account_.suspects.empty())
      account_.suspects.push_back(*mismatch);
    account_.doubt = runner().in_doubt();
    if (account_.doubt) problem.cause += doubt_text(*account_.doubt);
    if (!begun) {
      problem.cause += "; nothing was to be written yet";
      return std::unexpected(std::move(problem));
    }
    problem.cause += fmt::format("; {} writes were sent", runner().totals().writes);
    if (!problem.remedy.empty()) problem.remedy += "; then ";
    const std::string command = again();
    problem.remedy +=
        action_ == Action::undo
            ? fmt::format("{0} --undo goes on to the old bytes, {0} --resume to those of the image", command)
            : fmt::format("{0} --resume finishes, {0} --undo brings the old bytes back", command);
    return std::unexpected(std::move(problem));
  }

  /// How this restore is called up again.
  [[nodiscard]] std::string again() const {
    std::string text =
        fmt::format("tm485 eeprom restore {} {}", encoder_.session->port().text(), options_.file);
    if (journal_path_ != default_journal(options_.file)) text += " --journal " + journal_path_;
    return text;
  }

  [[nodiscard]] std::string json_text() {
    JsonObject json;
    json.set("port", encoder_.session->port().text()).set("file", options_.file);
    json.set("profile", encoder_.session->profile().profile().name).set("enid", unsigned{encoder_.enid});
    json.set("action", name(action_)).set("outcome", account_.outcome);
    json.set("journal", journal_path_).set("backup", journal_.backup_file);
    json.set("bytes", target().bytes.size()).set("differing", account_.differing);
    json.set("crc32", crc32_text(target().bytes));
    add_totals(json, runner().totals());
    json.set("rounds", account_.rounds)
        .set("read_ns", account_.read_time.count())
        .set("write_ns", account_.write_time.count());
    json.set("verify_ns", account_.verify_time.count());
    json.set("total_ns", (account_.read_time + account_.write_time + account_.verify_time).count());
    json.set("suspects", differences_json(account_.suspects));
    if (account_.doubt) json.set("in_doubt", doubt_json(*account_.doubt));
    return json.text() + '\n';
  }

  [[nodiscard]] std::string plain_text() {
    if (account_.outcome == "identical")
      return fmt::format("all {} bytes are as wanted already: nothing written\n", target().bytes.size());
    if (account_.outcome != "done") return {};
    std::string text;
    if (action_ == Action::restore) text += fmt::format("backup      {}\n", journal_.backup_file);
    text += fmt::format("journal     {} ({})\n", journal_path_, name(journal_.state));
    text += fmt::format("written     {} bytes that differed, in {}\n", account_.differing,
                        milliseconds_text(account_.write_time));
    text += fmt::format("verified    all {} bytes, CRC-32 {}\n", target().bytes.size(),
                        crc32_text(target().bytes));
    text += fmt::format("took        {} ({}): {}\n",
                        milliseconds_text(account_.read_time + account_.write_time + account_.verify_time),
                        encoder_.session->clock_name(), totals_text(runner().totals()));
    if (action_ == Action::restore) text += fmt::format("take back   {} --undo\n", again());
    return text;
  }

  int show() {
    Output output;
    output.write(options_.port.json ? json_text() : plain_text());
    return finish(output, kExitGood);
  }

  const EepromOptions& options_;
  const EepromOpener& open_;
  Action action_;
  std::string journal_path_;
  std::string journal_base_;  ///< of a restore: what the journals' names are made of
  EepromJournal journal_;
  EepromSession encoder_;
  Account account_;
};

}  // namespace

int run_eeprom_restore(const EepromOptions& options, const EepromOpener& open) {
  return Restore(options, open).run();
}

int run_eeprom_restore(const EepromOptions& options) {
  return run_eeprom_restore(options, [](const EepromOptions& same) { return open_eeprom(same); });
}

}  // namespace tm485::cli
