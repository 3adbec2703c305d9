#include "haptic/report.hpp"

#include <cerrno>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>

#include "file_replacement.hpp"

namespace haptic {
namespace {

double microseconds(std::int64_t duration_ns) {
    return static_cast<double>(duration_ns) * 1e-3;
}

/// errno as an error code; EIO if errno is not set.
std::error_code last_error() {
    return {errno != 0 ? errno : EIO, std::generic_category()};
}

}  // namespace

nlohmann::json summary_us(const Histogram& histogram) {
    return {{"min", microseconds(histogram.min_ns())},
            {"p50", microseconds(histogram.percentile_ns(0.5))},
            {"p99", microseconds(histogram.percentile_ns(0.99))},
            {"p999", microseconds(histogram.percentile_ns(0.999))},
            {"max", microseconds(histogram.max_ns())},
            {"count", histogram.count()}};
}

nlohmann::json buckets_us(const Histogram& histogram) {
    nlohmann::json buckets = nlohmann::json::array();
    for (std::size_t i = 0; i < Histogram::kBuckets; ++i) {
        const Histogram::Bucket bucket = histogram.bucket(i);
        if (bucket.count != 0) {
            buckets.push_back({microseconds(bucket.lower_ns), microseconds(bucket.upper_ns), bucket.count});
        }
    }
    return buckets;
}

void write_report(const std::filesystem::path& file, const nlohmann::json& report) {
    const std::filesystem::path temporary = detail::temporary_beside(file);
    errno = 0;
    std::ofstream stream(temporary, std::ios::binary | std::ios::trunc);
    stream << report.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
    stream.close();
    const std::error_code error = stream ? detail::put_in_place(temporary, file) : last_error();
    if (error) {
        detail::discard(temporary, file);
        throw std::runtime_error(file.string() + ": the report cannot be written: " + error.message());
    }
}

}  // namespace haptic
