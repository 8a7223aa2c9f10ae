// tm485 decode: bytes in, what they say out.

#include <fmt/format.h>

#include <cerrno>
#include <optional>
#include <system_error>

#include "commands.hpp"
#include "frame_view.hpp"
#include "hex_input.hpp"
#include "json_output.hpp"
#include "line_reader.hpp"
#include "output.hpp"
#include "problem.hpp"
#include "profile_file.hpp"

namespace tm485::cli {
namespace {

class Decoder {
 public:
  Decoder(const CompiledProfile& profile, std::optional<FrameKind> kind, bool json)
      : profile_(&profile), kind_(kind), json_(json) {}

  /// False once nobody reads the output any more.
  bool frame(std::span<const std::uint8_t> bytes) {
    const FrameView view = view_frame(bytes, kind_.value_or(guess_kind(bytes)), *profile_);
    if (view.error != Errc::ok) all_good_ = false;
    return output_.write(json_ ? to_json(view) + '\n' : to_text(view, bytes));
  }

  /// A line of input that is no frame at all.
  bool bad_line(std::uint64_t number, std::string_view error, std::string_view cause) {
    all_good_ = false;
    if (!json_) return output_.write(fmt::format("line {}: {}: {}\n", number, error, cause));
    JsonObject json;
    json.set("ok", false).set("error", error).set("line", number).set("cause", cause);
    return output_.write(json.text() + '\n');
  }

  Output& output() { return output_; }
  [[nodiscard]] int exit_code() { return finish(output_, all_good_ ? kExitGood : kExitFailure); }

 private:
  const CompiledProfile* profile_;
  std::optional<FrameKind> kind_;
  bool json_;
  bool all_good_ = true;
  Output output_;
};

int decode_arguments(const std::vector<std::string>& arguments, Decoder& decoder) {
  std::vector<FrameBytes> frames;
  for (const std::string& argument : arguments) {
    auto bytes = parse_hex(argument);
    if (bytes && bytes->size() == 0) bytes = std::unexpected<std::string>("no byte in it");
    if (!bytes) {
      return report(usage_problem("bad_hex", fmt::format("argument {}: {}", frames.size() + 1, bytes.error()),
                                  "write bytes in hexadecimal: \"1A 20 13 6E 01 11 05 00 00 40 12\""));
    }
    frames.push_back(*bytes);
  }
  for (const FrameBytes& frame : group_frames(frames))
    if (!decoder.frame(frame.bytes())) break;
  return decoder.exit_code();
}

int decode_input(Decoder& decoder) {
  LineReader reader;
  std::string_view line;
  for (std::uint64_t number = 1;; ++number) {
    if (reader.drained() && !decoder.output().flush()) break;
    const LineReader::Result result = reader.next(line);
    if (result == LineReader::Result::end) break;
    if (result == LineReader::Result::failed) {
      (void)decoder.output().flush();
      return report({"input_failed", "standard input: " + std::generic_category().message(errno),
                     "look at where the input comes from", kExitFailure});
    }
    bool going = true;
    if (result == LineReader::Result::too_long) {
      going = decoder.bad_line(number, "line_too_long",
                               fmt::format("more than {} characters", LineReader::kLongest));
    } else if (const auto bytes = parse_hex(line); !bytes) {
      going = decoder.bad_line(number, "bad_hex", bytes.error());
    } else if (bytes->size() != 0) {
      going = decoder.frame(bytes->bytes());
    }
    if (!going) break;
  }
  return decoder.exit_code();
}

}  // namespace

int run_decode(const DecodeOptions& options) {
  const auto profile = load_profile(options.profile);
  if (!profile) return report(profile.error());
  std::optional<FrameKind> kind;
  if (!options.as.empty()) kind = options.as == "request" ? FrameKind::request : FrameKind::reply;
  Decoder decoder(*profile, kind, options.json);
  return options.frames.empty() ? decode_input(decoder) : decode_arguments(options.frames, decoder);
}

}  // namespace tm485::cli
