#include "haptic/sim/curl_track.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "haptic/csv.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

CurlTrack::CurlTrack(std::vector<double> times_s, std::vector<double> curls)
    : times_s_(std::move(times_s)), curls_(std::move(curls)) {
    if (times_s_.size() != curls_.size()) {
        throw std::invalid_argument("curl track: needs one curl for each time");
    }
    for (std::size_t i = 0; i < curls_.size(); ++i) {
        if (!(curls_[i] >= 0.0 && curls_[i] <= 1.0)) {
            throw std::invalid_argument("curl track: a curl must be 0 to 1");
        }
        if (!std::isfinite(times_s_[i]) || (i > 0 && !(times_s_[i] > times_s_[i - 1]))) {
            throw std::invalid_argument("curl track: times must increase");
        }
    }
}

CurlTrack CurlTrack::load(const std::filesystem::path& file) {
    const CsvTable table = CsvTable::load(file);
    const auto curl = table.find("curl");
    if (!curl) {
        return {};
    }
    const auto time = table.column("time_s");
    try {
        return {{time.begin(), time.end()}, {curl->begin(), curl->end()}};
    } catch (const std::invalid_argument& wrong) {
        throw CsvError(table.name() + ": " + wrong.what());
    }
}

double CurlTrack::at(std::int64_t time_ns) const noexcept {
    if (!known()) {
        return 0.0;
    }
    const double time_s = seconds(time_ns);
    const auto after = std::upper_bound(times_s_.begin(), times_s_.end(), time_s) - times_s_.begin();
    if (after == 0) {
        return curls_.front();
    }
    const auto next = static_cast<std::size_t>(after);
    if (next == times_s_.size()) {
        return curls_.back();
    }
    const double part = (time_s - times_s_[next - 1]) / (times_s_[next] - times_s_[next - 1]);
    return curls_[next - 1] + part * (curls_[next] - curls_[next - 1]);
}

}  // namespace haptic::sim
