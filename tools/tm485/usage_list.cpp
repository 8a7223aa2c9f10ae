#include "usage_list.hpp"

namespace tm485::cli {

void add_list(CLI::App& root, ListOptions& options) {
  CLI::App& app =
      *root.add_subcommand("list", "The serial ports of this machine: chip, driver, what they hold");
  app.add_flag("--json", options.json, "One JSON object a port");
  // For tests: where the system describes itself. In no group, so not in the help.
  app.add_option("--sysfs-root", options.system.sysfs)->group("");
  app.add_option("--dev-root", options.system.dev)->group("");
  app.footer(
      "Opens no port, so nothing moves on a line. A port is judged at 2.5 Mbit/s by its chip: the driver's "
      "word is no\n"
      "proof. \"unknown\" means that the first replies have to tell.\n"
      "Examples:\n"
      "  tm485 list\n"
      "  tm485 list --json\n"
      "  tm485 info /dev/serial/by-id/usb-FTDI_C232HM_FT4X-if00-port0      a name that stays");
}

}  // namespace tm485::cli
