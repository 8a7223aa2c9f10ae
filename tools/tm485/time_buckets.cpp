#include "time_buckets.hpp"

namespace tm485::cli {

std::vector<Bucket> TimeBuckets::filled() const {
  std::vector<Bucket> buckets;
  for (std::size_t at = 0; at < counts_.size(); ++at)
    if (counts_[at] != 0) buckets.push_back({first_of(at), first_of(at + 1) - Time{1}, counts_[at]});
  return buckets;
}

std::vector<Bucket> buckets_of(const linux_hal::TimeHistogram& histogram) {
  using Histogram = linux_hal::TimeHistogram;
  std::vector<Bucket> buckets;
  for (std::size_t at = 0; at < Histogram::kBuckets; ++at)
    if (histogram.bucket(at) != 0)
      buckets.push_back({Histogram::first_of(at), Histogram::last_of(at), histogram.bucket(at)});
  return buckets;
}

JsonObject to_json(const std::vector<Bucket>& buckets) {
  std::vector<std::int64_t> first;
  std::vector<std::int64_t> last;
  std::vector<std::int64_t> count;
  for (const Bucket& bucket : buckets) {
    first.push_back(bucket.first.count());
    last.push_back(bucket.last.count());
    count.push_back(static_cast<std::int64_t>(bucket.count));
  }
  JsonObject json;
  json.set("first_ns", first).set("last_ns", last).set("count", count);
  return json;
}

}  // namespace tm485::cli
