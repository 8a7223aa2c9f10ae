#include "tm485/linux/rt_settings.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>

#include "realtime_remedy.hpp"

namespace tm485::linux_hal {
namespace {

namespace fs = std::filesystem;

constexpr unsigned kCapIpcLock = 14;  // linux/capability.h
constexpr unsigned kCapSysNice = 23;
constexpr std::uint64_t kNeededPriority = 80;
constexpr std::uint64_t kNeededLock = 64U << 20;

/// The files below one root. No file, and one that cannot be read, is nullopt.
class Files {
 public:
  explicit Files(fs::path root) : root_(std::move(root)) {}

  /// Without blanks at the end.
  [[nodiscard]] std::optional<std::string> text(const std::string& path) const {
    std::ifstream file(root_ / path);
    if (!file) return std::nullopt;
    std::string text{std::istreambuf_iterator<char>(file), {}};
    if (file.bad()) return std::nullopt;
    text.erase(text.find_last_not_of(" \t\n") + 1);
    return text;
  }
  [[nodiscard]] std::optional<std::int64_t> number(const std::string& path) const {
    const auto found = text(path);
    std::int64_t value = 0;
    if (!found || std::from_chars(found->data(), found->data() + found->size(), value).ec != std::errc{})
      return std::nullopt;
    return value;
  }
  /// The rest of the line that begins with `key`, from the first character that is no blank.
  [[nodiscard]] std::optional<std::string> field(const std::string& path, std::string_view key) const {
    std::ifstream file(root_ / path);
    for (std::string line; std::getline(file, line);) {
      if (!line.starts_with(key)) continue;
      const auto begin = line.find_first_not_of(" \t", key.size());
      return begin == std::string::npos ? std::string() : line.substr(begin);
    }
    return std::nullopt;
  }
  /// Names of the entries of a folder that begin with `prefix` and a digit, sorted by that number.
  [[nodiscard]] std::vector<std::string> numbered(const std::string& folder, std::string_view prefix) const {
    std::vector<std::string> names;
    std::error_code error;
    for (fs::directory_iterator entry(root_ / folder, error), end; !error && entry != end;
         entry.increment(error)) {
      const std::string name = entry->path().filename().string();
      if (name.size() > prefix.size() && name.starts_with(prefix) &&
          std::all_of(name.begin() + static_cast<std::ptrdiff_t>(prefix.size()), name.end(),
                      [](char c) { return c >= '0' && c <= '9'; }))
        names.push_back(name);
    }
    std::sort(names.begin(), names.end(), [](const std::string& a, const std::string& b) {
      return a.size() != b.size() ? a.size() < b.size() : a < b;
    });
    return names;
  }

 private:
  fs::path root_;
};

RtSetting unknown(std::string name, std::string remedy) {
  return {std::move(name), "not told", Verdict::unknown, std::move(remedy)};
}

/// How many CPUs a list such as "0-3,6" has.
std::size_t cpus_in(std::string_view list) {
  std::size_t count = 0;
  const char* at = list.data();
  const char* const end = at + list.size();
  while (at < end) {
    unsigned first = 0;
    const auto low = std::from_chars(at, end, first);
    if (low.ec != std::errc{}) return 0;
    unsigned last = first;
    at = low.ptr;
    if (at < end && *at == '-') {
      const auto high = std::from_chars(at + 1, end, last);
      if (high.ec != std::errc{} || last < first) return 0;
      at = high.ptr;
    }
    count += last - first + 1;
    if (at < end && *at != ',') return 0;
    if (at < end) ++at;
  }
  return count;
}

RtSetting kernel(const Files& files) {
  const auto release = files.text("proc/sys/kernel/osrelease");
  const auto version = files.text("proc/sys/kernel/version");
  if (!release && !version) return unknown("kernel", "");
  RtSetting setting{"kernel", release.value_or("?") + ", ", Verdict::bad,
                    "install a real-time kernel: on Debian linux-image-rt-amd64 (or -rt-arm64); without it "
                    "the system's own work delays a thread of any priority"};
  if (files.number("sys/kernel/realtime") == 1 ||
      (version && version->find("PREEMPT_RT") != std::string::npos))
    return {"kernel", setting.value + "PREEMPT_RT", Verdict::good, ""};
  if (version && version->find("PREEMPT") != std::string::npos) {
    setting.value += version->find("PREEMPT_DYNAMIC") != std::string::npos ? "PREEMPT_DYNAMIC" : "PREEMPT";
    setting.verdict = Verdict::improvable;
  } else {
    setting.value += "no preemption";
  }
  return setting;
}

RtSetting cpus(const Files& files) {
  const auto online = files.text("sys/devices/system/cpu/online");
  const std::size_t count = online ? cpus_in(*online) : 0;
  if (count == 0) return unknown("cpus", "");
  if (count == 1)
    return {"cpus", "1 (" + *online + ")", Verdict::bad,
            "use a machine with two cores or more: a thread that spins on the only one leaves nothing for "
            "the rest, so use WaitMode::sleep here"};
  return {"cpus", std::to_string(count) + " (" + *online + ")", Verdict::good, ""};
}

RtSetting isolated(const Files& files) {
  const auto list = files.text("sys/devices/system/cpu/isolated");
  if (!list) return unknown("isolated", "");
  if (!list->empty()) return {"isolated", "cores " + *list, Verdict::good, ""};
  return {"isolated", "none", Verdict::improvable,
          "keep other work off one core: isolcpus=N on the kernel's command line (GRUB_CMDLINE_LINUX in "
          "/etc/default/grub, then update-grub and reboot), and pin the thread to N"};
}

RtSetting nohz_full(const Files& files) {
  const auto list = files.text("sys/devices/system/cpu/nohz_full");
  if (list && !list->empty() && *list != "(null)") return {"nohz_full", "cores " + *list, Verdict::good, ""};
  if (list)
    return {"nohz_full", "none", Verdict::improvable,
            "stop the timer tick on the isolated core: nohz_full=N rcu_nocbs=N on the kernel's command line"};
  return {"nohz_full", "not in this kernel", Verdict::improvable,
          "use a kernel with CONFIG_NO_HZ_FULL (Debian's have it), then nohz_full=N rcu_nocbs=N on its "
          "command line"};
}

RtSetting governor(const Files& files) {
  const std::string folder = "sys/devices/system/cpu";
  std::set<std::string> kinds;
  std::string others;
  for (const std::string& cpu : files.numbered(folder, "cpu")) {
    const auto kind =
        files.text(std::string(folder).append("/").append(cpu).append("/cpufreq/scaling_governor"));
    if (!kind) continue;
    kinds.insert(*kind);
    if (*kind != "performance")
      others.append(others.empty() ? "" : ", ").append(cpu).append(" ").append(*kind);
  }
  if (kinds.empty())
    return {"governor", "none: the frequency is not this kernel's to choose", Verdict::unknown,
            "in a virtual machine look at the host; otherwise the firmware's power settings decide"};
  if (others.empty()) return {"governor", "performance", Verdict::good, ""};
  return {"governor", others, Verdict::improvable,
          "hold the frequency: sudo cpupower frequency-set -g performance (package linux-cpupower); a core "
          "that sleeps at a low frequency wakes up late"};
}

RtSetting clocksource(const Files& files) {
  const auto source = files.text("sys/devices/system/clocksource/clocksource0/current_clocksource");
  if (!source || source->empty()) return unknown("clocksource", "");
  constexpr std::array<std::string_view, 5> kFast{"tsc", "arch_sys_counter", "kvm-clock",
                                                  "hyperv_clocksource_tsc_page", "riscv_clocksource"};
  constexpr std::array<std::string_view, 4> kSlow{"hpet", "acpi_pm", "jiffies", "refined-jiffies"};
  if (std::find(kFast.begin(), kFast.end(), *source) != kFast.end())
    return {"clocksource", *source, Verdict::good, ""};
  if (std::find(kSlow.begin(), kSlow.end(), *source) == kSlow.end())
    return {"clocksource", *source, Verdict::unknown, ""};
  return {"clocksource", *source, Verdict::bad,
          "every reading of this clock is a system call of a microsecond or more, or is coarse: see "
          "'journalctl -k -g clocksource' for why the CPU's own counter was given up; tsc=reliable on the "
          "kernel's command line takes it anyway"};
}

bool has_capability(const Files& files, unsigned number) {
  const auto text = files.field("proc/self/status", "CapEff:");
  std::uint64_t mask = 0;
  return text && std::from_chars(text->data(), text->data() + text->size(), mask, 16).ec == std::errc{} &&
         (mask >> number & 1U) != 0;
}

/// The soft limit; the largest number for "unlimited".
std::optional<std::uint64_t> soft_limit(const Files& files, std::string_view name) {
  const auto text = files.field("proc/self/limits", name);
  if (!text) return std::nullopt;
  if (text->starts_with("unlimited")) return UINT64_MAX;
  std::uint64_t value = 0;
  if (std::from_chars(text->data(), text->data() + text->size(), value).ec != std::errc{})
    return std::nullopt;
  return value;
}

RtSetting rtprio(const Files& files) {
  if (has_capability(files, kCapSysNice))
    return {"rtprio", "any (capability CAP_SYS_NICE)", Verdict::good, ""};
  const auto limit = soft_limit(files, "Max realtime priority");
  if (!limit) return unknown("rtprio", "");
  const std::string value = *limit == UINT64_MAX ? "unlimited" : "up to " + std::to_string(*limit);
  if (*limit >= kNeededPriority) return {"rtprio", value, Verdict::good, ""};
  return {"rtprio", *limit == 0 ? "none allowed" : value, *limit == 0 ? Verdict::bad : Verdict::improvable,
          kPriorityRemedy};
}

RtSetting memlock(const Files& files) {
  if (has_capability(files, kCapIpcLock))
    return {"memlock", "any (capability CAP_IPC_LOCK)", Verdict::good, ""};
  const auto limit = soft_limit(files, "Max locked memory");
  if (!limit) return unknown("memlock", "");
  if (*limit == UINT64_MAX) return {"memlock", "unlimited", Verdict::good, ""};
  return {"memlock", std::to_string(*limit / 1024) + " KiB",
          *limit >= kNeededLock ? Verdict::improvable : Verdict::bad, kLockRemedy};
}

RtSetting rt_throttling(const Files& files) {
  const auto runtime = files.number("proc/sys/kernel/sched_rt_runtime_us");
  const auto period = files.number("proc/sys/kernel/sched_rt_period_us");
  if (!runtime) return unknown("rt_throttling", "");
  if (*runtime < 0) return {"rt_throttling", "off", Verdict::good, ""};
  return {"rt_throttling",
          std::to_string(*runtime) + " us of every " + std::to_string(period.value_or(1'000'000)),
          Verdict::improvable,
          "a thread that spins is stopped for the rest whenever ordinary work waits on its core (50 ms by "
          "default): use an isolated core and sudo sysctl kernel.sched_rt_runtime_us=-1; never with a thread "
          "that spins on the only core"};
}

RtSetting fair_server(const Files& files) {
  const std::string folder = "sys/kernel/debug/sched/fair_server";
  std::string budgets;
  bool all_zero = true;
  for (const std::string& cpu : files.numbered(folder, "cpu")) {
    const auto runtime = files.number(std::string(folder).append("/").append(cpu).append("/runtime"));
    if (!runtime) continue;
    all_zero = all_zero && *runtime == 0;
    budgets.append(budgets.empty() ? "" : ", ")
        .append(cpu)
        .append(" ")
        .append(std::to_string(*runtime / 1'000))
        .append(" us");
  }
  if (budgets.empty())
    return unknown("fair_server",
                   "kernels from 6.12 on keep 50 ms of every second for ordinary work: look as root, with "
                   "debugfs mounted, at /sys/kernel/debug/sched/fair_server");
  if (all_zero) return {"fair_server", "off", Verdict::good, ""};
  return {"fair_server", budgets, Verdict::improvable,
          "ordinary work that waits on the core interrupts a spinning thread for this long every second: use "
          "an isolated core, or as root: echo 0 > /sys/kernel/debug/sched/fair_server/cpuN/runtime"};
}

}  // namespace

std::string_view verdict_name(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::good:
      return "good";
    case Verdict::improvable:
      return "improvable";
    case Verdict::bad:
      return "bad";
    case Verdict::unknown:
      break;
  }
  return "unknown";
}

std::vector<RtSetting> read_rt_settings(const fs::path& root) {
  const Files files(root);
  return {kernel(files),      cpus(files),   isolated(files), nohz_full(files),     governor(files),
          clocksource(files), rtprio(files), memlock(files),  rt_throttling(files), fair_server(files)};
}

}  // namespace tm485::linux_hal
