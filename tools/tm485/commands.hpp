// The sub-commands: what each may be told, and the functions that carry them out. main.cpp fills the options in.
// Every function answers the exit code and has reported its problems.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tm485/linux/port_identity.hpp"

namespace tm485::cli {

struct DecodeOptions {
  std::vector<std::string> frames;  ///< empty: lines of standard input
  std::string profile = "any";
  std::string as;  ///< "request", "reply", or empty: by length
  bool json = false;
};
int run_decode(const DecodeOptions& options);

/// What every command that talks to an encoder can be told.
struct PortOptions {
  std::string port;
  std::string profile;           ///< empty: the one that fits the port
  std::string max_speed;         ///< empty: that of AxisConfig
  std::string max_acceleration;  ///< likewise
  std::string latency;           ///< of the port and the host; empty: what the port states
  bool echo = false;             ///< the port receives its own requests
  std::string direction =
      "auto";             ///< who switches the RS-485 driver, in the words of linux_hal::parse_direction
  bool any_chip = false;  ///< open also a chip that is known not to make the bit rate
  bool json = false;
  linux_hal::SystemPaths system = {};  ///< tests put their own there
};

struct InfoOptions {
  PortOptions port;
};
int run_info(const InfoOptions& options);

struct ReadOptions {
  PortOptions port;
  unsigned id = 3;
  std::uint64_t count = 10;  ///< 0: until Ctrl-C
  std::string period;  ///< empty: 1 ms, or the shortest that the port holds; "min": the shortest possible
  std::string units = "counts";
};
int run_read(const ReadOptions& options);

struct MonitorOptions {
  PortOptions port;
  unsigned id = 3;
  std::string period;   ///< empty: the shortest possible
  std::string seconds;  ///< empty: until Ctrl-C
  bool virtual_time = false;
};
int run_monitor(const MonitorOptions& options);

struct BenchOptions {
  PortOptions port;
  unsigned id = 3;
  std::string period;  ///< empty: the shortest possible
  std::string seconds = "2";
  bool virtual_time = false;
  std::string plot;  ///< picture to draw, .png or .svg; empty: none
  bool yes = false;  ///< it may replace one
};
int run_bench(const BenchOptions& options);

struct DoctorOptions {
  PortOptions port;
};
int run_doctor(const DoctorOptions& options);

struct SimCommandOptions {
  bool pty = false;
  std::string unix_path;
  std::string link;
  std::string profile = "tm485_17";
  std::string rpm;
  std::optional<std::uint64_t> seed;
  std::string almc;
  bool echo = false;
  std::string ber;     ///< in the words of sim::parse_sim_options; empty: no wrong bits
  std::string lost;    ///< likewise, of lost replies
  std::string plan;    ///< of faults, as text or a file; empty: none
  std::string boot;    ///< how long it is silent after its start; empty: not at all
  std::string eeprom;  ///< file that keeps the EEPROM; empty: none
  // Of the EEPROM, in the words of sim::parse_sim_options; empty: its defaults.
  std::string eeprom_pages;
  std::string eeprom_write;
  std::string eeprom_page;
  std::string eeprom_fail;
  std::optional<std::uint64_t> eeprom_seed;
  bool eeprom_deaf = false;
};
int run_sim(const SimCommandOptions& options);

/// All quantities as typed.
struct ServoDemoOptions {
  std::string port = "sim:";
  bool virtual_time = false;
  std::string seconds = "2";
  std::string feedback = "both";
  unsigned id = 0;
  std::string amplitude = "90deg";
  std::string frequency;                ///< of a swing; empty: 2 Hz, unless there is a speed
  std::string speed;                    ///< of point-to-point moves; empty: a swing
  std::string bandwidth = "1kHz";       ///< of the estimator
  unsigned states = 3;                  ///< of the estimator
  std::optional<int> priority;          ///< of the threads in real time; none: by the machine
  std::string velocity_loop = "200Hz";  ///< its crossover
  std::string load = "0";               ///< Nm
  std::string hold = "2ms";             ///< how long the axis goes on without a fresh sample
  std::string outage;                   ///< no reply for this long, in the middle of the run; empty: none
  std::string drift = "0";              ///< of the servo clock against that of the bus, ppm
  bool json = false;
};
int run_servo_demo(const ServoDemoOptions& options);

struct RtCheckOptions {
  std::string period = "1ms";
  std::string seconds = "2";  ///< of each measure
  bool json = false;
  bool strict = false;  ///< exit code 1 if a setting is bad
};
int run_rt_check(const RtCheckOptions& options);

/// What the EEPROM commands can be told; each uses its own part.
struct EepromOptions {
  PortOptions port;
  bool virtual_time = false;
  std::string file;
  std::string format;  ///< bin or json; empty: by the file's name
  unsigned page = 0;
  unsigned address = 0;
  unsigned count = 1;
  std::string hex;      ///< bytes to write
  std::string journal;  ///< of a restore; empty: FILE.journal
  std::string backup;   ///< of a restore; empty: beside FILE, with the date in its name
  bool resume = false;
  bool undo = false;
  bool yes = false;
};
int run_eeprom_read(const EepromOptions& options);
int run_eeprom_write(const EepromOptions& options);
int run_eeprom_dump(const EepromOptions& options);
int run_eeprom_verify(const EepromOptions& options);
int run_eeprom_diff(const EepromOptions& options);
int run_eeprom_restore(const EepromOptions& options);

struct ResetOptions {
  PortOptions port;
  bool virtual_time = false;
  std::string what;  ///< errors, multiturn, zero
  bool yes = false;
  bool yes_realign = false;  ///< zero: the motor's electrical alignment may move
};
int run_reset(const ResetOptions& options);

struct CampaignCommandOptions {
  std::optional<std::uint64_t> cycles;
  std::uint64_t seed = 1;
  std::string plan;    ///< text or file; empty: random plans
  unsigned jobs = 0;   ///< 0: one for each processor
  std::string replay;  ///< SEED:RUN; empty: a campaign
  std::string vcd;     ///< of a replay; empty: none
  bool json = false;
};
int run_campaign_command(const CampaignCommandOptions& options);

struct ListOptions {
  bool json = false;
  linux_hal::SystemPaths system = {};  ///< tests put their own there
};
int run_list(const ListOptions& options);

/// The presets.
int run_profiles(bool json);

}  // namespace tm485::cli
