#include "doctor/reading.hpp"

#include <algorithm>
#include <array>

namespace tm485::cli::doctor {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::array<std::uint8_t, 3> kEnids{0x00, 0x11, 0x17};

bool known_enid(std::uint8_t enid) { return std::ranges::find(kEnids, enid) != kEnids.end(); }
bool known_sf(unsigned sf) { return (sf & 0xCFU) == 0; }

/// Whether the end of `bytes` is that of a reply to `id`. With one byte lost or spoilt the CRC tells; with two it tells
/// if the SF that it asks for is a possible one; of a long reply ENID and the reserved top of ABM tell as well.
/// A reply whose first byte is right has a good beginning.
bool only_ends_like_a_reply(Bytes bytes, DataId id) {
  const std::size_t length = layout(id).reply_length;
  if (bytes.size() == length && bytes[0] == control_field(id)) return false;
  for (std::size_t spoilt = 1; spoilt <= 2 && bytes.size() + spoilt >= length; ++spoilt) {
    if (bytes.size() > length + 1) break;  // a false start adds one at most
    const Bytes tail = bytes.last(length - spoilt);
    unsigned rest = control_field(id);
    for (const std::uint8_t byte : tail) rest ^= byte;
    if (spoilt == 1 ? rest == 0 : known_sf(rest)) return true;
  }
  if (id != DataId::everything || bytes.size() > length + 1) return false;
  constexpr std::size_t kFromEnid = 6;  // ENID ABM ABM ABM ALMC CRC
  if (bytes.size() < kFromEnid) return false;
  const Bytes tail = bytes.last(kFromEnid);
  return known_enid(tail[0]) && tail[3] == 0 && tail[4] == 0;
}

/// Whether `bytes` begin as `sent` does if it is inverted, after a lead of any length.
bool begins_inverted(Bytes bytes, Bytes sent) {
  constexpr unsigned kLongestLead = 40;  // ten bits: from there on it is idle line
  for (unsigned lead = 0; lead <= kLongestLead; ++lead) {
    const auto expected = inverted(sent, lead);
    if (expected.empty() || bytes.size() < expected.size()) continue;
    if (std::ranges::equal(expected, bytes.first(expected.size()))) return true;
  }
  return false;
}

bool is_inverted_reply(Bytes bytes, const Request& request) {
  if (request.id() != DataId::encoder_id) return false;
  constexpr std::array<std::uint8_t, 4> kStatus{0x00, 0x10, 0x20, 0x30};
  for (const std::uint8_t sf : kStatus) {
    for (const std::uint8_t enid : kEnids) {
      const std::uint8_t cf = control_field(request.id());
      const std::array reply{cf, sf, enid, static_cast<std::uint8_t>(cf ^ sf ^ enid)};
      if (begins_inverted(bytes, reply)) return true;
    }
  }
  return false;
}

/// The request, or a reply to ID2, of which nearly every byte is known. Behind the echo of the request its last stop bit,
/// which is a start bit now, puts the receiver out of step for the reply.
bool is_inverted(Bytes bytes, const Request& request) {
  return begins_inverted(bytes, request.bytes()) || is_inverted_reply(bytes, request);
}

}  // namespace

Reading read(const Heard& heard, const Request& request, bool timestamps) {
  Reading reading;
  if (heard.count == 0) {
    reading.error = heard.fault == Errc::ok ? Errc::timeout : heard.fault;
    return reading;
  }
  const Bytes bytes = heard.all();
  const std::size_t echo = request.bytes().size();
  const auto is_reply = [&](std::size_t from) {
    const auto frame = Frame::parse(bytes.subspan(from), request.id());
    if (!frame) return false;
    reading.kind = Kind::reply;
    reading.echoed = from != 0;
    reading.frame = *frame;
    reading.seen_after = heard.first_seen - heard.request_end;
    if (timestamps) reading.t2 = heard.starts[from] - heard.request_end;
    return true;
  };
  // A reply begins with the byte that a short request consists of, so the reply comes first.
  if (is_reply(0)) return reading;
  const bool echoed = std::ranges::equal(bytes.first(std::min(echo, bytes.size())), request.bytes());
  if (echoed && bytes.size() > echo && is_reply(echo)) return reading;

  const auto frame = Frame::parse(bytes, request.id());
  const std::size_t length = layout(request.id()).reply_length;
  reading.error = heard.fault != Errc::ok ? heard.fault
                  : bytes.size() < length ? Errc::incomplete_reply
                  : bytes.size() > length ? Errc::overlong_reply
                                          : frame.error();
  if (echoed && bytes.size() == echo)
    reading.kind = Kind::echo;
  else if (is_inverted(bytes, request))
    reading.kind = Kind::inverted;
  else if (only_ends_like_a_reply(bytes, request.id()))
    reading.kind = Kind::spoilt_start;
  else
    reading.kind = Kind::garbage;
  return reading;
}

Reading read_after_echo(const Heard& heard, const Request& request, bool timestamps) {
  const std::size_t echo = request.bytes().size();
  if (heard.count < echo) return read(heard, request, timestamps);
  Heard rest = heard;
  rest.count -= echo;
  std::ranges::copy(heard.all().subspan(echo), rest.bytes.begin());
  std::ranges::copy(std::span(heard.starts).subspan(echo), rest.starts.begin());
  Reading reading = read(rest, request, timestamps);
  reading.echoed = true;
  const bool same = std::ranges::equal(heard.all().first(echo), request.bytes());
  if (!same && reading.kind == Kind::silence) reading.error = Errc::echo_mismatch;
  return reading;
}

std::vector<std::uint8_t> inverted(std::span<const std::uint8_t> bytes, unsigned lead) {
  constexpr unsigned kQuarters = 4;  // of a bit
  constexpr unsigned kDataBits = 8;
  std::vector<bool> space(lead, true);
  const auto drive = [&space](bool mark) { space.insert(space.end(), kQuarters, mark); };
  for (const std::uint8_t byte : bytes) {
    drive(false);
    for (unsigned bit = 0; bit < kDataBits; ++bit) drive((byte >> bit & 1U) != 0);
    drive(true);
  }
  space.resize(space.size() - kQuarters);  // what the last stop bit makes depends on the driver's tail
  const auto is_space = [&space](std::size_t at) { return at < space.size() && space[at]; };

  std::vector<std::uint8_t> heard;
  for (std::size_t at = 0; at < space.size();) {
    const bool falls = is_space(at) && (at == 0 || !is_space(at - 1));
    if (!falls || !is_space(at + kQuarters / 2)) {
      ++at;
      continue;
    }
    unsigned byte = 0;
    std::size_t sample = at + kQuarters + kQuarters / 2;
    for (unsigned bit = 0; bit < kDataBits; ++bit, sample += kQuarters)
      if (!is_space(sample)) byte |= 1U << bit;
    heard.push_back(static_cast<std::uint8_t>(byte));
    at = sample;
    while (is_space(at)) ++at;  // no stop bit: wait for mark
    ++at;
  }
  return heard;
}

}  // namespace tm485::cli::doctor
