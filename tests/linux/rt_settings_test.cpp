// The settings of made-up machines: files of /proc and /sys in a temporary folder.
#include "tm485/linux/rt_settings.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace tm485::linux_hal {
namespace {

namespace fs = std::filesystem;

class RtSettings : public testing::Test {
 protected:
  RtSettings() {
    std::string name = (fs::temp_directory_path() / "tm485_settings_XXXXXX").string();
    root_ = mkdtemp(name.data());
  }
  ~RtSettings() override { fs::remove_all(root_); }

  void write(const std::string& path, const std::string& text) {
    fs::create_directories((root_ / path).parent_path());
    std::ofstream(root_ / path) << text;
  }
  RtSetting get(const std::string& name) {
    for (const RtSetting& setting : read_rt_settings(root_))
      if (setting.name == name) return setting;
    ADD_FAILURE() << "no setting " << name;
    return {};
  }
  void expect(const std::string& name, Verdict verdict, const std::string& in_value,
              const std::string& in_remedy = "") {
    const RtSetting setting = get(name);
    EXPECT_EQ(setting.verdict, verdict) << name << ": " << setting.value;
    EXPECT_NE(setting.value.find(in_value), std::string::npos) << name << ": " << setting.value;
    EXPECT_NE(setting.remedy.find(in_remedy), std::string::npos) << name << ": " << setting.remedy;
    if (verdict != Verdict::unknown) {
      EXPECT_EQ(setting.remedy.empty(), verdict == Verdict::good) << name << ": " << setting.remedy;
    }
  }

  static constexpr const char* kCpu = "sys/devices/system/cpu/";
  static std::string limits(const std::string& priority, const std::string& memory) {
    return "Limit                     Soft Limit           Hard Limit           Units     \n"
           "Max cpu time              unlimited            unlimited            seconds   \n"
           "Max locked memory         " +
           memory +
           "              8388608              bytes     \n"
           "Max realtime priority     " +
           priority +
           "                    99                    \n"
           "Max realtime timeout      unlimited            unlimited            us        \n";
  }

  fs::path root_;
};

TEST_F(RtSettings, AnEmptyTreeIsUnknownAndHasEveryName) {
  std::vector<std::string> names;
  for (const RtSetting& setting : read_rt_settings(root_)) {
    names.push_back(setting.name);
    EXPECT_FALSE(setting.value.empty()) << setting.name;
    EXPECT_EQ(setting.verdict, setting.name == "nohz_full" ? Verdict::improvable : Verdict::unknown)
        << setting.name;
  }
  EXPECT_EQ(names,
            (std::vector<std::string>{"kernel", "cpus", "isolated", "nohz_full", "governor", "clocksource",
                                      "rtprio", "memlock", "rt_throttling", "fair_server"}));
  EXPECT_EQ(read_rt_settings(root_ / "no" / "such" / "folder").size(), names.size());
}

TEST_F(RtSettings, KernelKinds) {
  write("proc/sys/kernel/osrelease", "6.1.0-18-amd64\n");
  write("proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC Debian 6.1.76-1\n");
  expect("kernel", Verdict::improvable, "6.1.0-18-amd64, PREEMPT_DYNAMIC", "linux-image-rt");
  write("proc/sys/kernel/version", "#1 SMP PREEMPT Debian\n");
  expect("kernel", Verdict::improvable, "PREEMPT", "linux-image-rt");
  write("proc/sys/kernel/version", "#1 SMP Debian\n");
  expect("kernel", Verdict::bad, "no preemption", "linux-image-rt");
  write("proc/sys/kernel/version", "#1 SMP PREEMPT_RT Debian\n");
  expect("kernel", Verdict::good, "PREEMPT_RT");
  write("proc/sys/kernel/version", "#1 SMP Custom\n");
  write("sys/kernel/realtime", "1\n");
  expect("kernel", Verdict::good, "PREEMPT_RT");
}

TEST_F(RtSettings, Cores) {
  write(std::string(kCpu) + "online", "0\n");
  expect("cpus", Verdict::bad, "1 (0)", "two cores");
  write(std::string(kCpu) + "online", "0-3,6,8-9\n");
  expect("cpus", Verdict::good, "7 (0-3,6,8-9)");
  for (const char* nonsense : {"", "x", "3-1", "0-", "1;2"}) {
    write(std::string(kCpu) + "online", nonsense);
    expect("cpus", Verdict::unknown, "");
  }
  write(std::string(kCpu) + "isolated", "\n");
  expect("isolated", Verdict::improvable, "none", "isolcpus");
  write(std::string(kCpu) + "isolated", "2-3\n");
  expect("isolated", Verdict::good, "2-3");
  expect("nohz_full", Verdict::improvable, "not in this kernel", "NO_HZ_FULL");
  write(std::string(kCpu) + "nohz_full", "(null)\n");
  expect("nohz_full", Verdict::improvable, "none", "nohz_full=");
  write(std::string(kCpu) + "nohz_full", "3\n");
  expect("nohz_full", Verdict::good, "3");
}

TEST_F(RtSettings, GovernorsOfEachCore) {
  const std::string cpu = kCpu;
  fs::create_directories(root_ / (cpu + "cpufreq"));
  fs::create_directories(root_ / (cpu + "cpuidle"));
  expect("governor", Verdict::unknown, "none");
  for (const char* core : {"cpu0", "cpu1", "cpu10"})
    write(cpu + core + "/cpufreq/scaling_governor", "performance\n");
  expect("governor", Verdict::good, "performance");
  write(cpu + "cpu10/cpufreq/scaling_governor", "powersave\n");
  write(cpu + "cpu1/cpufreq/scaling_governor", "schedutil\n");
  expect("governor", Verdict::improvable, "cpu1 schedutil, cpu10 powersave", "cpupower");
}

TEST_F(RtSettings, Clocksources) {
  const std::string path = "sys/devices/system/clocksource/clocksource0/current_clocksource";
  for (const char* fast : {"tsc\n", "arch_sys_counter\n", "kvm-clock\n"}) {
    write(path, fast);
    expect("clocksource", Verdict::good, "");
  }
  write(path, "hpet\n");
  expect("clocksource", Verdict::bad, "hpet", "clocksource");
  write(path, "something_new\n");
  expect("clocksource", Verdict::unknown, "something_new");
}

TEST_F(RtSettings, LimitsOfTheProcess) {
  write("proc/self/status", "Name:\ttm485\nCapPrm:\t000001ffffffffff\nCapEff:\t0000000000000000\n");
  write("proc/self/limits", limits("0", "8388608"));
  expect("rtprio", Verdict::bad, "none", "limits.d");
  expect("memlock", Verdict::bad, "8192 KiB", "limits.d");
  write("proc/self/limits", limits("50", "134217728"));
  expect("rtprio", Verdict::improvable, "50", "rtprio 99");
  expect("memlock", Verdict::improvable, "131072 KiB", "memlock unlimited");
  write("proc/self/limits", limits("80", "unlimited"));
  expect("rtprio", Verdict::good, "80");
  expect("memlock", Verdict::good, "unlimited");
  write("proc/self/limits", limits("unlimited", "rubbish"));
  expect("rtprio", Verdict::good, "unlimited");
  expect("memlock", Verdict::unknown, "");
}

TEST_F(RtSettings, CapabilitiesOverrideLimits) {
  write("proc/self/limits", limits("0", "0"));
  write("proc/self/status", "CapEff:\t0000000000800000\n");  // CAP_SYS_NICE
  expect("rtprio", Verdict::good, "CAP_SYS_NICE");
  expect("memlock", Verdict::bad, "0 KiB");
  write("proc/self/status", "CapEff:\t0000000000004000\n");  // CAP_IPC_LOCK
  expect("rtprio", Verdict::bad, "none");
  expect("memlock", Verdict::good, "CAP_IPC_LOCK");
}

TEST_F(RtSettings, ThrottlingAndTheFairServer) {
  write("proc/sys/kernel/sched_rt_runtime_us", "950000\n");
  write("proc/sys/kernel/sched_rt_period_us", "1000000\n");
  expect("rt_throttling", Verdict::improvable, "950000 us of every 1000000", "sched_rt_runtime_us=-1");
  write("proc/sys/kernel/sched_rt_runtime_us", "-1\n");
  expect("rt_throttling", Verdict::good, "off");
  const std::string server = "sys/kernel/debug/sched/fair_server/";
  expect("fair_server", Verdict::unknown, "", "as root");
  write(server + "cpu0/runtime", "50000000\n");
  write(server + "cpu1/runtime", "0\n");
  expect("fair_server", Verdict::improvable, "cpu0 50000 us", "isolated core");
  write(server + "cpu0/runtime", "0\n");
  expect("fair_server", Verdict::good, "off");
}

TEST(RtSettingsOfThisMachine, CanBeRead) {
  for (const RtSetting& setting : read_rt_settings()) {
    EXPECT_FALSE(setting.value.empty()) << setting.name;
    EXPECT_NE(verdict_name(setting.verdict), "") << setting.name;
  }
}

}  // namespace
}  // namespace tm485::linux_hal
