// The statistics: counters and histograms.
#include "tm485/bus/statistics.hpp"

using namespace tm485;

extern "C" {
void part_statistics_make(Statistics& to) { to = Statistics{}; }
void part_statistics_add(TimeStatistic& statistic, const Time& value) { statistic.add(value); }
void part_statistics_error(Statistics& statistics, Errc code) { statistics.count_error(code); }
}
