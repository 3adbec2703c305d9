// Fuzz target: the loader of device geometries. It must throw ConfigError or return a geometry that satisfies
// device_geometry_file.hpp. Any other exception ends the process, which the fuzzer reports.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <string_view>

#include "haptic/config.hpp"
#include "haptic/device/dac_codes.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/wrench_closure.hpp"
#include "require.hpp"

namespace {

using haptic::device::DeviceGeometry;

void check(const DeviceGeometry& geometry) {
    require(geometry.minimum_tension >= 0.0 && geometry.maximum_tension > geometry.minimum_tension &&
                std::isfinite(geometry.maximum_tension),
            "bounds of tension are ordered");
    for (std::size_t i = 0; i < haptic::kStrings; ++i) {
        const haptic::device::StringFacts& string = geometry.strings[i];
        const double length = geometry.rest_length(i);
        require(std::isfinite(length) && length > 0.0, "each string has a length");
        require(std::isnormal(string.metres_per_count) && std::isnormal(string.newtons_per_code), "scales are not 0");
        require(haptic::device::kMaxDacCode * std::fabs(string.newtons_per_code) >= geometry.maximum_tension,
                "DAC codes reach the largest tension");
    }
    require(geometry.board != haptic::device::BoardKind::Uart ||
                std::accumulate(geometry.uart_boards.begin(), geometry.uart_boards.end(), 0) == int(haptic::kStrings),
            "the boards on the line have eight strings");
    require(haptic::device::wrench_closure(geometry, {}).determined, "the strings determine the pose");
    const auto reach = haptic::device::wrench_reach(geometry, {}, {1.0, 0.0, 0.0, 0.0, 0.0, 0.0});
    require(!reach || (std::isfinite(*reach) && *reach >= 0.0), "the reach is a number");
    require(haptic::device::parse_device_geometry(haptic::device::to_toml(geometry, "copy"), "copy") == geometry,
            "what is written is read back to the same bits");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    try {
        check(haptic::device::parse_device_geometry({reinterpret_cast<const char*>(data), size}, "fuzz.toml"));
    } catch (const haptic::ConfigError& error) {
        require(std::string_view(error.what()).starts_with("fuzz.toml"), "an error names the file");
    }
    return 0;
}
