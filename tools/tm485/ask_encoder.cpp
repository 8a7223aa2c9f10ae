#include "ask_encoder.hpp"

#include "stop_signal.hpp"

namespace tm485::cli {

std::expected<Reply, Problem> ask_encoder(Session& session, DataId id) {
  constexpr int kTries = 10;
  constexpr std::uint32_t kTicket = 1;
  Bus<AnyPort>& bus = session.bus();
  Errc cause = Errc::timeout;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    if (const auto offered = bus.offer(*Request::make(id), kTicket); !offered) {
      cause = offered.error();
      break;
    }
    std::optional<Completion> completion;
    while (!completion) {
      (void)session.step();
      if (auto problem = session.failure()) return std::unexpected(std::move(*problem));
      completion = bus.take_completion(Priority::diagnostics, kTicket);
    }
    if (completion->result) return *completion->result;
    cause = completion->result.error();
    if (stop_requested())
      return std::unexpected(Problem{"stopped", "stopped before anything was changed", {}, kExitFailure});
  }
  Problem problem = problem_of(cause, session.port().text());
  problem.exit_code = kExitFailure;
  return std::unexpected(std::move(problem));
}

}  // namespace tm485::cli
