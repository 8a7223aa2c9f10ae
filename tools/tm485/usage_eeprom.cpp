#include "usage_eeprom.hpp"

namespace tm485::cli {
namespace {

void add_virtual(CLI::App& app, bool& virtual_time) {
  app.add_flag("--virtual", virtual_time, "Virtual time instead of the real clock (sim: only)");
}

CLI::App& add_command(CLI::App& eeprom, EepromOptions& options, AddPortOptions add_port_options,
                      const char* name, const char* help) {
  CLI::App& app = *eeprom.add_subcommand(name, help);
  add_port_options(app, options.port);
  add_virtual(app, options.virtual_time);
  return app;
}

void add_format(CLI::App& app, EepromOptions& options) {
  app.add_option("--format", options.format, "bin or json; default: by the name, .json or raw bytes")
      ->check(CLI::IsMember({"bin", "json"}));
}

void add_place(CLI::App& app, EepromOptions& options) {
  app.add_option("--page", options.page, "Page, from 0")->required();
  app.add_option("--addr", options.address, "Address in the page, 0 to 126; 0x10 is understood")->required();
}

void add_yes(CLI::App& app, EepromOptions& options) { app.add_flag("-y,--yes", options.yes, "Do not ask"); }

}  // namespace

void add_eeprom(CLI::App& root, EepromOptions& options, AddPortOptions add_port_options) {
  CLI::App& eeprom = *root.add_subcommand("eeprom", "Read, write, save and restore the encoder's EEPROM");
  eeprom.require_subcommand(1);
  eeprom.footer(
      "Examples:\n"
      "  tm485 eeprom dump /dev/ttyUSB0 -o motor.json\n"
      "  tm485 eeprom restore /dev/ttyUSB0 motor.json\n"
      "  tm485 eeprom read /dev/ttyUSB0 --page 2 --addr 0 --count 16\n"
      "Each has its own help and examples: tm485 eeprom restore --help");

  CLI::App& read = add_command(eeprom, options, add_port_options, "read", "Show bytes of one page");
  add_place(read, options);
  read.add_option("--count", options.count, "How many")->check(CLI::PositiveNumber)->capture_default_str();
  read.footer(
      "Examples:\n"
      "  tm485 eeprom read /dev/ttyUSB0 --page 2 --addr 0 --count 16\n"
      "  tm485 eeprom read sim: --page 0 --addr 0x7E --json --virtual");

  CLI::App& write = add_command(eeprom, options, add_port_options, "write", "Change bytes of one page");
  add_place(write, options);
  write.add_option("--hex", options.hex, "The bytes: \"A5 5A\", A55A")->required();
  add_yes(write, options);
  write.footer(
      "Reads everything before and after: all other bytes are as they were, or it says which are not. Bytes "
      "that are equal\nalready are not written.\n"
      "Example:\n"
      "  tm485 eeprom write /dev/ttyUSB0 --page 2 --addr 16 --hex \"A5 5A\" --yes");

  CLI::App& dump = add_command(eeprom, options, add_port_options, "dump", "Save all bytes in a file");
  dump.add_option("-o,--output", options.file, "File to write; asks before it replaces one")->required();
  add_format(dump, options);
  add_yes(dump, options);
  dump.footer(
      "Examples:\n"
      "  tm485 eeprom dump /dev/ttyUSB0 -o motor.json      pages in hexadecimal, ENID, date, CRC-32\n"
      "  tm485 eeprom dump /dev/ttyUSB0 -o motor.bin       the bytes, page after page\n"
      "  tm485 eeprom dump sim: -o image.bin --virtual --json");

  CLI::App& verify =
      add_command(eeprom, options, add_port_options, "verify", "Are all bytes those of a file?");
  verify.add_option("FILE", options.file, "Image, as dump writes it")->required();
  add_format(verify, options);
  verify.footer(
      "Exit code 1 if a byte differs.\n"
      "Example:\n"
      "  tm485 eeprom verify /dev/ttyUSB0 motor.json");

  CLI::App& diff =
      add_command(eeprom, options, add_port_options, "diff", "Show the bytes that differ from a file");
  diff.add_option("FILE", options.file, "Image, as dump writes it")->required();
  add_format(diff, options);
  diff.footer(
      "Prints nothing, with exit code 0, if no byte differs; otherwise exit code 1.\n"
      "Example:\n"
      "  tm485 eeprom diff /dev/ttyUSB0 motor.json");

  CLI::App& restore =
      add_command(eeprom, options, add_port_options, "restore", "Make all bytes those of a file");
  restore.add_option("FILE", options.file, "Image, as dump writes it")->required();
  add_format(restore, options);
  CLI::Option* resume = restore.add_flag("--resume", options.resume, "Finish a restore that was interrupted");
  restore.add_flag("--undo", options.undo, "Bring back what was there before the restore")->excludes(resume);
  restore.add_option("--journal", options.journal, "File that says how far it is; default: FILE.journal");
  restore.add_option("--backup", options.backup,
                     "File for what was there before; must not exist. Default: FILE.DATE.backup.json");
  add_yes(restore, options);
  restore.footer(
      "First saves what is there to a backup file and a journal, then writes only the bytes that differ, "
      "then "
      "verifies all.\n"
      "After Ctrl-C, a crash, unplugging or a power failure at any moment, --resume finishes and --undo "
      "takes "
      "it back.\n"
      "Examples:\n"
      "  tm485 eeprom restore /dev/ttyUSB0 motor.json\n"
      "  tm485 eeprom restore /dev/ttyUSB0 motor.json --resume\n"
      "  tm485 eeprom restore /dev/ttyUSB0 motor.json --undo --yes");
}

void add_reset(CLI::App& root, ResetOptions& options, AddPortOptions add_port_options) {
  CLI::App& app = *root.add_subcommand("reset", "Clear error bits, the turn count, or set the zero position");
  add_port_options(app, options.port);
  app.add_option(
         "WHAT", options.what,
         "errors: latched error bits (ID7); multiturn: them and the turn count (IDC); zero: the present "
         "position becomes single-turn 0 (ID8)")
      ->required()
      ->check(CLI::IsMember({"errors", "multiturn", "zero"}));
  add_virtual(app, options.virtual_time);
  app.add_flag("-y,--yes", options.yes, "Do not ask (errors, multiturn)");
  app.add_flag("--yes-realign", options.yes_realign,
               "zero: do not ask; the motor's electrical alignment moves and will be set anew");
  app.footer(
      "Ten equal requests, then the encoder is read back: exit code 0 only if that shows the effect.\n"
      "zero wants a shaft that stands still. A drive that commutates by the encoder's zero must be aligned "
      "again before the\nmotor is switched on; where only the position shall read 0 here, an offset in the "
      "AxisConfig is the better way.\n"
      "Examples:\n"
      "  tm485 reset /dev/ttyUSB0 errors\n"
      "  tm485 reset /dev/ttyUSB0 multiturn --yes --json\n"
      "  tm485 reset sim: zero --yes-realign --virtual");
}

int run_eeprom(const CLI::App& root, const EepromOptions& options) {
  const CLI::App& eeprom = *root.get_subcommand("eeprom");
  if (eeprom.got_subcommand("read")) return run_eeprom_read(options);
  if (eeprom.got_subcommand("write")) return run_eeprom_write(options);
  if (eeprom.got_subcommand("dump")) return run_eeprom_dump(options);
  if (eeprom.got_subcommand("verify")) return run_eeprom_verify(options);
  if (eeprom.got_subcommand("diff")) return run_eeprom_diff(options);
  return run_eeprom_restore(options);
}

}  // namespace tm485::cli
