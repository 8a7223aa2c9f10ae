#include "eeprom_session.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "ask_encoder.hpp"
#include "profile_file.hpp"

namespace tm485::cli {

std::expected<EepromShape, Problem> shape_of(const PortOptions& options) {
  const auto profile =
      load_profile(options.profile.empty() ? AnyPort::default_profile(options.port) : options.profile);
  if (!profile) return std::unexpected(profile.error());
  return shape_of(profile->profile());
}

std::expected<EepromSession, Problem> open_eeprom(const EepromOptions& options) {
  SessionOptions settings;
  settings.port = options.port;
  settings.virtual_time = options.virtual_time;
  settings.cyclic = false;
  auto opened = Session::open(settings);
  if (!opened) return std::unexpected(std::move(opened.error()));
  return open_eeprom(std::move(*opened));
}

std::expected<EepromSession, Problem> open_eeprom(std::unique_ptr<Session> session) {
  EepromSession encoder;
  encoder.session = std::move(session);
  if (auto started = encoder.session->wait_for_startup(); !started) {
    started.error().exit_code = kExitFailure;
    return std::unexpected(std::move(started.error()));
  }
  const auto reply = ask_encoder(*encoder.session, DataId::encoder_id);
  if (!reply) return std::unexpected(reply.error());
  encoder.enid = reply->frame().enid();
  encoder.runner = std::make_unique<EepromRunner>(*encoder.session);
  return encoder;
}

std::expected<EepromImage, Problem> read_image(EepromSession& encoder, std::string_view label) {
  EepromImage image;
  image.shape = encoder.runner->shape();
  image.bytes.resize(image.shape.size());
  image.enid = encoder.enid;
  image.profile = std::string(encoder.session->profile().profile().name);
  image.date = date_text();
  if (auto done = encoder.runner->read(0, image.bytes, label); !done)
    return std::unexpected(std::move(done.error()));
  return image;
}

std::string differences_text(const std::vector<ByteDifference>& all, std::size_t most) {
  std::string text;
  for (std::size_t i = 0; i < all.size() && i < most; ++i)
    text += fmt::format("\n  page {}, address {:>3}: wanted {:02X}, found {:02X}", all[i].page,
                        all[i].address, all[i].wanted, all[i].found);
  if (all.size() > most) text += fmt::format("\n  and {} more", all.size() - most);
  return text;
}

std::vector<JsonObject> differences_json(const std::vector<ByteDifference>& all) {
  std::vector<JsonObject> result;
  for (const ByteDifference& difference : all) {
    JsonObject json;
    json.set("page", difference.page).set("address", difference.address);
    json.set("wanted", unsigned{difference.wanted}).set("found", unsigned{difference.found});
    result.push_back(std::move(json));
  }
  return result;
}

std::string doubt_text(const EepromDoubt& doubt) {
  std::string text =
      fmt::format("; page {}, address {} may be wrong until it is finished", doubt.page, doubt.address);
  if (const auto pages = pages_of(doubt.pages); !pages.empty())
    text += fmt::format(", and if noise has garbled the last request, any byte of page {}",
                        fmt::join(pages, ", "));
  return text;
}

JsonObject doubt_json(const EepromDoubt& doubt) {
  JsonObject json;
  json.set("page", unsigned{doubt.page}).set("address", unsigned{doubt.address});
  json.set("pages", pages_of(doubt.pages));
  return json;
}

void add_totals(JsonObject& json, const EepromTotals& totals) {
  json.set("writes", totals.writes).set("page_selects", totals.page_selects);
  json.set("retries", totals.retries).set("repaired", totals.repaired);
  json.set("unconfirmed_pages", pages_of(totals.unconfirmed_pages));
}

std::string totals_text(const EepromTotals& totals) {
  return fmt::format("{} writes, {} page changes, {} retries, {} repaired", totals.writes,
                     totals.page_selects, totals.retries, totals.repaired);
}

std::string milliseconds_text(Time time) {
  return fmt::format("{:.1f} ms", std::chrono::duration<double, std::milli>(time).count());
}

}  // namespace tm485::cli
