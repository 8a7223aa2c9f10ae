// tm485 bench --plot in a build without cairo: refused before anything is measured.
#include "plot.hpp"

namespace tm485::cli {
namespace {

Problem no_pictures() {
  return usage_problem("bad_plot", "this program was built without cairo, so it draws no pictures",
                       "leave --plot out and use --json, or build with -DTM485_WITH_CAIRO=ON");
}

}  // namespace

std::expected<void, Problem> check_plot_file(const std::string&) { return std::unexpected(no_pictures()); }

std::expected<void, Problem> draw(const Plot&, const std::string&) { return std::unexpected(no_pictures()); }

}  // namespace tm485::cli
