// Journals of a restore: any content is refused or is a journal whose two images have the shape.
#include <string>

#include "eeprom_journal.hpp"
#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"

namespace tm485::fuzz {

/// What one of so many inputs is for besides.
constexpr unsigned kOwnOnceIn = 16;

/// Shape and state; then the content, which is also that of a journal's images.
int fuzz_journal(std::span<const std::uint8_t> bytes) {
  using namespace cli;
  Input input(bytes);
  const EepromShape shape{1 + input.below(3), 1 + input.below(16)};
  const auto state = static_cast<JournalState>(input.below(3));
  const bool own_too = input.below(kOwnOnceIn) == 0;
  const std::string content(input.text());
  if (const auto journal = parse_journal(content, shape, "x.journal")) {
    require(journal->wanted.bytes.size() == shape.size() && journal->before.bytes.size() == shape.size(),
            "as many bytes as the encoder has");
    const auto again = parse_journal(journal_text(*journal), shape, "x.journal");
    require(again && again->wanted.bytes == journal->wanted.bytes && again->state == journal->state,
            "what was written is read again");
  } else {
    require(!journal.error().remedy.empty(), "a refusal with a remedy");
  }
  if (!own_too) return 0;
  EepromJournal own;
  own.state = state;
  own.port = content.substr(0, 30);
  own.wanted.shape = own.before.shape = shape;
  for (std::size_t i = 0; i < shape.size(); ++i)
    own.wanted.bytes.push_back(content.empty() ? std::uint8_t{0}
                                               : static_cast<std::uint8_t>(content[i % content.size()]));
  own.before.bytes.assign(shape.size(), 0xFF);
  const auto read = parse_journal(journal_text(own), shape, "x.journal");
  require(read && read->state == state && read->wanted.bytes == own.wanted.bytes &&
              read->before.bytes == own.before.bytes,
          "a journal that was written is read again");
  return 0;
}

}  // namespace tm485::fuzz
