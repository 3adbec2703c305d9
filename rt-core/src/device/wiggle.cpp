#include "device/wiggle.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string>

#include "haptic/csv.hpp"
#include "haptic/frames.hpp"

namespace haptic::rt {
namespace {

/// The difference nearest to zero of two counters modulo 2^bits.
std::int64_t nearest_difference(std::uint64_t to, std::uint64_t from, int bits) {
    const std::uint64_t wrap = std::uint64_t{1} << static_cast<unsigned>(bits);
    const std::uint64_t difference = (to - from) & (wrap - 1);
    return static_cast<std::int64_t>(difference) - (difference >= wrap / 2 ? static_cast<std::int64_t>(wrap) : 0);
}

}  // namespace

Wiggle load_wiggle(const std::filesystem::path& recording, const device::DeviceGeometry& geometry) {
    // Columns of the state and of the eight counters.
    CsvReader reader(recording);
    const std::size_t state = reader.index("safety_state");
    std::array<std::size_t, kStrings> columns{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        columns[i] = reader.index("counter" + std::to_string(i));
    }
    const int bits = device::counter_bits(geometry.board);
    Wiggle wiggle;
    std::array<std::uint64_t, kStrings> last{};
    while (reader.next()) {
        // Only the first uninterrupted run is used.
        if (reader.natural(state) != HAPTIC_RUNNING) {
            if (!wiggle.empty()) {
                break;  // rows after another arming have another calibration
            }
            continue;
        }
        // Counts since the first running row, unwrapped across overflows of the counters.
        StringCounts counts{};
        for (std::size_t i = 0; i < kStrings; ++i) {
            const std::uint64_t counter = reader.natural(columns[i]);
            counts[i] = wiggle.empty() ? 0 : wiggle.back()[i] + nearest_difference(counter, last[i], bits);
            last[i] = counter;
        }
        wiggle.push_back(counts);
    }
    if (wiggle.empty()) {
        throw CsvError(reader.name() + ": the loop is not running in any row (safety_state 3)");
    }
    return wiggle;
}

Wiggle thinned(const Wiggle& wiggle, std::size_t max_samples) {
    if (wiggle.size() <= max_samples || max_samples == 0) {
        return wiggle;
    }
    // Counts, largest movement of a string between two samples.
    const auto max_change_between = [](const StringCounts& a, const StringCounts& b) {
        std::int64_t max_change = 0;
        for (std::size_t i = 0; i < kStrings; ++i) {
            max_change = std::max(max_change, std::abs(a[i] - b[i]));
        }
        return max_change;
    };
    // Raise the minimum movement between samples until few enough remain.
    Wiggle taken;
    for (std::int64_t min_movement = 1;; min_movement += std::max<std::int64_t>(1, min_movement / 4)) {
        taken.assign(1, wiggle.front());
        for (const StringCounts& counts : wiggle) {
            if (max_change_between(counts, taken.back()) >= min_movement) {
                taken.push_back(counts);
            }
        }
        if (taken.size() <= max_samples) {
            return taken;
        }
    }
}

}  // namespace haptic::rt
