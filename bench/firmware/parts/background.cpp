// The background: what waits for free time.
#include <expected>
#include <optional>

#include "tm485/bus/background.hpp"

using namespace tm485;

extern "C" {
bool part_background_offer(BackgroundQueue& queue, const Request& request, std::uint32_t ticket) {
  return queue.offer(request, ticket).has_value();
}
const Request* part_background_next(const BackgroundQueue& queue) { return queue.next(); }
bool part_background_passed(BackgroundQueue& queue, std::uint32_t most) {
  return queue.on_slot_passed(most).has_value();
}
void part_background_complete(BackgroundQueue& queue, Priority priority,
                              const std::expected<Reply, Errc>& result) {
  queue.complete(priority, result);
}
void part_background_end(BackgroundQueue& queue) {
  queue.complete_all(Errc::bad_state, std::nullopt, Errc::abandoned);
}
void part_background_take(BackgroundQueue& queue, std::optional<Completion>& to) { to = queue.take(); }
}
