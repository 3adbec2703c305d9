#include "haptic/report.hpp"

#include <nlohmann/json.hpp>

#include "haptic/text_file.hpp"

namespace haptic {
namespace {

double microseconds(std::int64_t duration_ns) {
    return static_cast<double>(duration_ns) * 1e-3;
}

/// Of either kind of histogram.
template <class AnyHistogram>
nlohmann::json summary_of(const AnyHistogram& histogram) {
    return {{"min", microseconds(histogram.min_ns())},
            {"p50", microseconds(histogram.percentile_ns(0.5))},
            {"p99", microseconds(histogram.percentile_ns(0.99))},
            {"p999", microseconds(histogram.percentile_ns(0.999))},
            {"max", microseconds(histogram.max_ns())},
            {"count", histogram.count()}};
}

template <class AnyHistogram>
nlohmann::json buckets_of(const AnyHistogram& histogram) {
    nlohmann::json buckets = nlohmann::json::array();
    for (std::size_t i = 0; i < AnyHistogram::kBuckets; ++i) {
        const Histogram::Bucket bucket = histogram.bucket(i);
        if (bucket.count != 0) {
            buckets.push_back({microseconds(bucket.lower_ns), microseconds(bucket.upper_ns), bucket.count});
        }
    }
    return buckets;
}

}  // namespace

nlohmann::json summary_us(const Histogram& histogram) {
    return summary_of(histogram);
}

nlohmann::json summary_us(const PeriodHistogram& histogram) {
    return summary_of(histogram);
}

nlohmann::json buckets_us(const Histogram& histogram) {
    return buckets_of(histogram);
}

nlohmann::json buckets_us(const PeriodHistogram& histogram) {
    return buckets_of(histogram);
}

void write_report(const std::filesystem::path& file, const nlohmann::json& report) {
    write_text(file, report.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + '\n');
}

}  // namespace haptic
