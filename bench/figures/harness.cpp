#include "harness.hpp"

#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <chrono>
#include <cstdio>

namespace tm485::figures {
namespace {

struct Spread {
  double median, smallest, largest;
};

Spread spread(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  const double median = values.size() % 2 == 1 ? values[half] : (values[half - 1] + values[half]) / 2;
  return {median, values.front(), values.back()};
}

std::string formatted(const char* format, double value) {
  std::array<char, 64> buffer{};
  std::snprintf(buffer.data(), buffer.size(), format, value);
  return buffer.data();
}

std::string padded(std::string text, std::size_t width) {
  text.resize(std::max(width, text.size()), ' ');
  return text;
}

bool set_fifo() {
  sched_param parameters{};
  parameters.sched_priority = 50;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0;
}

}  // namespace

double ns_per_tick() {
  static const double kResult = [] {
    using Clock = std::chrono::steady_clock;
    const auto begin = Clock::now();
    const std::uint64_t first = ticks();
    while (Clock::now() - begin < std::chrono::milliseconds(100)) {
    }
    const std::uint64_t last = ticks();
    const std::chrono::duration<double, std::nano> span = Clock::now() - begin;
    return span.count() / static_cast<double>(last - first);
  }();
  return kResult;
}

Pair::Pair(bool fifo) : fifo_(fifo) {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) return;
  for (int core = 0; core < CPU_SETSIZE && cores_.second < 0; ++core) {
    if (CPU_ISSET(static_cast<std::size_t>(core), &allowed))
      (cores_.first < 0 ? cores_.first : cores_.second) = core;
  }
  if (fifo_) {
    std::thread trial([this] { fifo_ = set_fifo(); });
    trial.join();
  }
}

void Pair::enter(int core) const {
  if (pinned()) {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(static_cast<std::size_t>(core), &one);
    pthread_setaffinity_np(pthread_self(), sizeof one, &one);
  }
  if (fifo_) set_fifo();
}

double Times::percentile(double fraction) {
  if (values_.empty()) return 0.0;
  const auto rank = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values_.size() - 1));
  std::nth_element(values_.begin(), values_.begin() + rank, values_.end());
  return static_cast<double>(values_[static_cast<std::size_t>(rank)]) * ns_per_tick();
}

void Table::add(const std::string& name, const std::string& unit, double value) {
  for (Row& row : rows_) {
    if (row.name == name) return row.rounds.push_back(value);
  }
  rows_.push_back({name, unit, {value}});
}

void Table::add_ratio(const std::string& name, const std::string& numerator, const std::string& denominator) {
  const Row* above = find(numerator);
  const Row* below = find(denominator);
  if (above == nullptr || below == nullptr) return;
  std::vector<double> rounds;
  for (std::size_t i = 0; i < std::min(above->rounds.size(), below->rounds.size()); ++i)
    rounds.push_back(above->rounds[i] / below->rounds[i]);
  for (const double value : rounds) add(name, "x", value);
}

const Table::Row* Table::find(const std::string& name) const {
  const auto row =
      std::find_if(rows_.begin(), rows_.end(), [&](const Row& each) { return each.name == name; });
  return row == rows_.end() ? nullptr : &*row;
}

std::string Table::text() const {
  std::string text = padded("", 58) + padded("unit", 8) + "    median       min       max\n";
  for (const Row& row : rows_) {
    const Spread values = spread(row.rounds);
    text += padded(row.name, 58) + padded(row.unit, 8);
    for (const double value : {values.median, values.smallest, values.largest})
      text += formatted("%10.2f", value);
    text += '\n';
  }
  return text;
}

std::string Table::json() const {
  std::string text;
  for (const Row& row : rows_) {
    const Spread values = spread(row.rounds);
    text += text.empty() ? "{\"" : ",\"";
    text += row.name + "\":{\"unit\":\"" + row.unit + '"';
    text +=
        ",\"median\":" + formatted("%.6g", values.median) + ",\"min\":" + formatted("%.6g", values.smallest);
    text += ",\"max\":" + formatted("%.6g", values.largest) + ",\"rounds\":[";
    for (std::size_t i = 0; i < row.rounds.size(); ++i) {
      if (i != 0) text += ',';
      text += formatted("%.6g", row.rounds[i]);
    }
    text += "]}";
  }
  text += "}\n";
  return text;
}

}  // namespace tm485::figures
