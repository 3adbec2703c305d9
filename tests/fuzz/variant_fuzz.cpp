// The loader of variants, fed with anything: it refuses with ConfigError, or gives a variant that keeps every promise
// of variant_file.hpp. Whatever else it throws ends the process, which the fuzzer reports.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <string_view>

#include "haptic/config.hpp"
#include "haptic/device/digits.hpp"
#include "haptic/device/variant_file.hpp"
#include "geometry/wrench_closure.hpp"

namespace {

using haptic::device::Variant;

void require(bool held, const char* what) {
    if (!held) {
        std::fprintf(stderr, "broken promise: %s\n", what);
        std::abort();
    }
}

void check(const Variant& variant) {
    require(variant.minimum_tension >= 0.0 && variant.maximum_tension > variant.minimum_tension &&
                std::isfinite(variant.maximum_tension),
            "bounds of tension are ordered");
    for (std::size_t i = 0; i < haptic::kStrings; ++i) {
        const haptic::device::StringFacts& string = variant.strings[i];
        const double length = variant.rest_length(i);
        require(std::isfinite(length) && length > 0.0, "each string has a length");
        require(std::isnormal(string.metres_per_count) && std::isnormal(string.newtons_per_digit), "scales are not 0");
        require(haptic::device::kMaximumDigit * std::fabs(string.newtons_per_digit) >= variant.maximum_tension,
                "digits make the largest tension");
    }
    require(variant.board != haptic::device::BoardKind::Uart ||
                std::accumulate(variant.uart_boards.begin(), variant.uart_boards.end(), 0) == int(haptic::kStrings),
            "the boards on the line have eight strings");
    require(haptic::device::wrench_closure(variant, {}).determined, "the strings determine the pose");
    const auto reach = haptic::device::wrench_reach(variant, {}, {1.0, 0.0, 0.0, 0.0, 0.0, 0.0});
    require(!reach || (std::isfinite(*reach) && *reach >= 0.0), "the reach is a number");
    require(haptic::device::parse_variant(haptic::device::to_toml(variant, "copy"), "copy") == variant,
            "what is written is read back to the same bits");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    try {
        check(haptic::device::parse_variant({reinterpret_cast<const char*>(data), size}, "fuzz.toml"));
    } catch (const haptic::ConfigError& error) {
        require(std::string_view(error.what()).starts_with("fuzz.toml"), "an error names the file");
    }
    return 0;
}
