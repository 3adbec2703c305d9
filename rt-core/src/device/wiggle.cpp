#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include <haptic/csv.hpp>
#include "device/geometry_fit.hpp"

namespace haptic::rt {
namespace {

constexpr double kMillimetres = 1e3;
constexpr double kPercent = 1e2;

/// The difference nearest to zero of two counters modulo 2^bits.
std::int64_t nearest_difference(std::uint64_t to, std::uint64_t from, int bits) {
    const std::uint64_t wrap = std::uint64_t{1} << static_cast<unsigned>(bits);
    const std::uint64_t difference = (to - from) & (wrap - 1);
    return static_cast<std::int64_t>(difference) - (difference >= wrap / 2 ? static_cast<std::int64_t>(wrap) : 0);
}

std::string line_of(const FittedValue& value) {
    char text[120];
    const double unit = value.is_scale ? kPercent : kMillimetres;
    std::snprintf(text, sizeof text, "  %-18s %+9.4f +- %7.4f %s%s\n", value.name.c_str(), unit * value.change,
                  unit * value.deviation, value.is_scale ? "%" : "mm",
                  value.determined() ? "" : "   the wiggle says little of it");
    return text;
}

}  // namespace

Wiggle load_wiggle(const std::filesystem::path& recording, const device::Variant& variant) {
    CsvReader reader(recording);
    const std::size_t state = reader.index("safety_state");
    std::array<std::size_t, kStrings> columns{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        columns[i] = reader.index("counter" + std::to_string(i));
    }
    const int bits = device::counter_bits(variant.board);
    Wiggle wiggle;
    std::array<std::uint64_t, kStrings> last{};
    while (reader.next()) {
        if (reader.natural(state) != HAPTIC_RUNNING) {
            if (!wiggle.empty()) {
                break;  // what comes after another arming counts from elsewhere
            }
            continue;
        }
        StringCounts counts{};
        for (std::size_t i = 0; i < kStrings; ++i) {
            const std::uint64_t counter = reader.natural(columns[i]);
            counts[i] = wiggle.empty() ? 0 : wiggle.back()[i] + nearest_difference(counter, last[i], bits);
            last[i] = counter;
        }
        wiggle.push_back(counts);
    }
    if (wiggle.empty()) {
        throw CsvError(reader.name() + ": in no row the loop was running (safety_state 3)");
    }
    return wiggle;
}

Wiggle thinned(const Wiggle& wiggle, std::size_t most) {
    if (wiggle.size() <= most || most == 0) {
        return wiggle;
    }
    const auto moved = [](const StringCounts& a, const StringCounts& b) {
        std::int64_t largest = 0;
        for (std::size_t i = 0; i < kStrings; ++i) {
            largest = std::max(largest, std::abs(a[i] - b[i]));
        }
        return largest;
    };
    // The least movement between samples that leaves few enough of them.
    Wiggle taken;
    for (std::int64_t least = 1;; least += std::max<std::int64_t>(1, least / 4)) {
        taken.assign(1, wiggle.front());
        for (const StringCounts& counts : wiggle) {
            if (moved(counts, taken.back()) >= least) {
                taken.push_back(counts);
            }
        }
        if (taken.size() <= most) {
            return taken;
        }
    }
}

std::string describe(const GeometryFit& fit) {
    char text[320];
    std::snprintf(text, sizeof text,
                  "%zu samples, %d iterations, %s\n"
                  "rms of the redundant lengths: %.1f um before, %.1f um after; noise of a length %.1f um\n"
                  "%zu lengths were out by more than 3 noises and count less\n",
                  fit.samples, fit.iterations, fit.converged ? "converged" : "NOT converged", fit.rms_before * 1e6,
                  fit.rms_after * 1e6, fit.noise * 1e6, fit.outliers);
    std::string lines = text;
    lines += "change from the nominal value +- standard deviation:\n";
    for (const FittedValue& value : fit.values) {
        lines += line_of(value);
    }
    const auto told = std::count_if(fit.values.begin(), fit.values.end(),
                                    [](const FittedValue& value) { return value.determined(); });
    std::snprintf(text, sizeof text, "%td of %zu values are known at least twice as well as before\n", told,
                  fit.values.size());
    return lines + text;
}

}  // namespace haptic::rt
