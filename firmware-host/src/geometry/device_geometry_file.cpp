#include "haptic/device/device_geometry_file.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <iterator>
#include <numeric>
#include <stdexcept>

#include "geometry/built_in_geometries.hpp"
#include "haptic/config.hpp"
#include "haptic/device/dac_codes.hpp"
#include "haptic/device/wrench_closure.hpp"

namespace haptic::device {
namespace {

constexpr Range kCoordinate{-1.0, 1.0};        // m
constexpr Range kMetresPerCount{-1e-3, 1e-3};  // m
constexpr double kMinMetresPerCount = 1e-8;
constexpr Range kNewtonsPerCode{-1.0, 1.0};  // N
constexpr double kMinNewtonsPerCode = 1e-6;
constexpr Range kTension{0.0, 200.0};       // N
constexpr Range kThermalTime{0.0, 3600.0};  // s
constexpr double kShortest = 0.005;         // m, of a string at the centre: a shorter one is an error in the lists

constexpr std::array<const char*, 3> kBoards = {"sh4", "simple", "uart"};

/// Unit vector, device frame, of a direction as the user in front of the device sees it; z points toward the user.
struct NamedDirection {
    const char* name;
    std::array<double, 3> direction;
};
constexpr std::array<NamedDirection, 6> kDirections = {{{"right", {1.0, 0.0, 0.0}},
                                                        {"left", {-1.0, 0.0, 0.0}},
                                                        {"up", {0.0, 1.0, 0.0}},
                                                        {"down", {0.0, -1.0, 0.0}},
                                                        {"toward", {0.0, 0.0, 1.0}},
                                                        {"away", {0.0, 0.0, -1.0}}}};

void require_given(const Config& config, const std::string& key) {
    if (!config.has(key)) {
        config.fail(key, "must be given");
    }
}

double required_number(const Config& config, const std::string& key, Range range) {
    require_given(config, key);
    return config.number(key, 0.0, range);
}

constexpr std::array<const char*, 3> kAxisKeys = {"axes.x", "axes.y", "axes.z"};
constexpr std::array<const char*, 3> kDefaultAxes = {"right", "up", "toward"};

/// Columns: directions of the lists' x, y and z in the device frame. A signed permutation, which is exact.
Mat3 read_axes(const Config& config) {
    std::vector<std::string> names;
    names.reserve(kDirections.size());
    for (const NamedDirection& one : kDirections) {
        names.emplace_back(one.name);
    }
    Mat3 axes(0.0);
    for (int k = 0; k < 3; ++k) {
        const auto index = static_cast<std::size_t>(k);
        const std::string chosen = config.choice(kAxisKeys[index], kDefaultAxes[index], names);
        const auto found = std::find_if(kDirections.begin(), kDirections.end(),
                                        [&](const NamedDirection& one) { return one.name == chosen; });
        axes[k] = Vec3(found->direction[0], found->direction[1], found->direction[2]);
        for (int before = 0; before < k; ++before) {
            if (glm::dot(axes[before], axes[k]) != 0.0) {
                config.fail(kAxisKeys[index], "is parallel to " +
                                                  std::string(kAxisKeys[static_cast<std::size_t>(before)]) +
                                                  "; use each of right/left, up/down and toward/away once");
            }
        }
    }
    return axes;
}

Vec3 read_point(const Config& config, const std::string& key, const Mat3& axes) {
    require_given(config, key);
    const Vec3 listed = config.vec3(key, {}, kCoordinate);
    return Vec3(0.0) + axes * listed;  // the sum turns -0 of a reversed axis into +0
}

/// A required scale of a string: its own, otherwise the common one at the top of the file.
double read_scale(const Config& config, const std::string& string, const std::string& name, Range range,
                  double min_magnitude) {
    const std::string own = string + "." + name;
    const double common = config.number(name, 0.0, range);
    if (!config.has(own) && !config.has(name)) {
        config.fail(own, "must be given, here or for all strings at the top of the file");
    }
    const double scale = config.number(own, common, range);
    if (std::fabs(scale) < min_magnitude) {
        config.fail(config.has(own) ? own : name, "must not be zero or close to it");
    }
    return scale;
}

constexpr const char* kNewtonsPerCodeKey = "newtons_per_code";
constexpr const char* kOldNewtonsPerCodeKey = "newtons_per_digit";  // former name, still accepted

/// Key that determines a string's newtons_per_code: its own before the common one, under the new name or the old one.
std::string newtons_per_code_key(const Config& config, const std::string& string) {
    for (const std::string& prefix : {string + ".", std::string()}) {
        for (const char* const name : {kNewtonsPerCodeKey, kOldNewtonsPerCodeKey}) {
            if (config.has(prefix + name)) {
                return prefix + name;
            }
        }
    }
    return string + "." + kNewtonsPerCodeKey;
}

/// Refuses a key that is given under both names.
void refuse_both_names(const Config& config, const std::string& prefix) {
    if (config.has(prefix + kNewtonsPerCodeKey) && config.has(prefix + kOldNewtonsPerCodeKey)) {
        config.fail(prefix + kOldNewtonsPerCodeKey, std::string("is the former name of ") + kNewtonsPerCodeKey +
                                                        ", which is given as well; remove one of the two");
    }
}

double read_newtons_per_code(const Config& config, const std::string& string) {
    refuse_both_names(config, "");
    refuse_both_names(config, string + ".");
    // Read all names, so that each counts as known and is checked.
    for (const std::string& prefix : {std::string(), string + "."}) {
        for (const char* const name : {kNewtonsPerCodeKey, kOldNewtonsPerCodeKey}) {
            (void)config.number(prefix + name, 0.0, kNewtonsPerCode);
        }
    }
    const std::string key = newtons_per_code_key(config, string);
    if (!config.has(key)) {
        config.fail(key, "must be given, here or for all strings at the top of the file");
    }
    const double scale = config.number(key, 0.0, kNewtonsPerCode);
    if (std::fabs(scale) < kMinNewtonsPerCode) {
        config.fail(key, "must not be zero or close to it");
    }
    return scale;
}

/// Prints a notice with FILE:LINE for the first use of the old name.
void note_old_names(const Config& config) {
    std::string key = kOldNewtonsPerCodeKey;
    for (std::size_t i = 0; i < kStrings && !config.has(key); ++i) {
        key = "string." + std::to_string(i) + "." + kOldNewtonsPerCodeKey;
    }
    if (!config.has(key)) {
        return;
    }
    try {
        config.fail(key, std::string("is the former name of ") + kNewtonsPerCodeKey + "; please rename it");
    } catch (const ConfigError& notice) {  // its text has the file and the line
        std::fprintf(stderr, "%s\n", notice.what());
    }
}

/// An optional number of a string: its own, otherwise the common one, otherwise 0 for unknown.
double read_optional(const Config& config, const std::string& string, const std::string& name, Range range) {
    return config.number(string + "." + name, config.number(name, 0.0, range), range);
}

StringFacts read_string(const Config& config, const std::string& key, const Mat3& axes) {
    StringFacts string;
    string.motor = read_point(config, key + ".motor", axes);
    string.grip = read_point(config, key + ".grip", axes);
    string.metres_per_count = read_scale(config, key, "metres_per_count", kMetresPerCount, kMinMetresPerCount);
    string.newtons_per_code = read_newtons_per_code(config, key);
    string.continuous_tension = read_optional(config, key, "continuous_tension", kTension);
    string.thermal_time_constant_s = read_optional(config, key, "thermal_time_constant_s", kThermalTime);
    if (glm::length(string.motor - string.grip) < kShortest) {
        config.fail(key + ".motor", "is less than 5 mm from the knot on the grip: the string has no length");
    }
    return string;
}

/// The channels that drive the motors: each once.
void read_motor_channels(const Config& config, DeviceGeometry& geometry) {
    std::array<bool, kStrings> used{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const std::string key = "string." + std::to_string(i) + ".motor_channel";
        const auto channel = static_cast<std::size_t>(
            config.integer(key, static_cast<std::int64_t>(i), {0, static_cast<double>(kStrings) - 1}));
        geometry.motor_channels[i] = static_cast<std::uint8_t>(channel);
        if (used[channel]) {
            config.fail(key, "channel " + std::to_string(channel) +
                                 " drives another motor already; each motor needs its own channel, and one without "
                                 "this key has the number of its string");
        }
        used[channel] = true;
    }
}

void read_strings(const Config& config, DeviceGeometry& geometry) {
    const Mat3 axes = read_axes(config);
    const std::size_t count = config.tables("string");
    if (count != kStrings) {
        config.fail("string", "exactly 8 tables [[string]] are required, the file has " + std::to_string(count));
    }
    for (std::size_t i = 0; i < kStrings; ++i) {
        const std::string key = "string." + std::to_string(i);
        geometry.strings[i] = read_string(config, key, axes);
        const double strongest = kMaxDacCode * std::fabs(geometry.strings[i].newtons_per_code);
        if (strongest < geometry.maximum_tension) {
            config.fail(newtons_per_code_key(config, key),
                        "the largest DAC code, 4095, gives " + std::to_string(strongest) +
                            " N, less than maximum_tension: lower maximum_tension or correct this value");
        }
    }
}

void read_tensions(const Config& config, DeviceGeometry& geometry) {
    geometry.minimum_tension = required_number(config, "minimum_tension", kTension);
    geometry.maximum_tension = required_number(config, "maximum_tension", kTension);
    if (!(geometry.maximum_tension > geometry.minimum_tension)) {
        config.fail("maximum_tension", "must be larger than minimum_tension");
    }
}

std::vector<int> read_uart_boards(const Config& config) {
    require_given(config, "uart_boards");
    const std::vector<double> counts = config.numbers("uart_boards", {}, {1, kStrings});
    const auto whole = [](double number) { return number == std::trunc(number); };
    if (!std::all_of(counts.begin(), counts.end(), whole) ||
        std::accumulate(counts.begin(), counts.end(), 0.0) != double(kStrings)) {
        config.fail("uart_boards", "must be an integer number of strings for each board, 8 in total");
    }
    return {counts.begin(), counts.end()};
}

DeviceGeometry read_device_geometry(const Config& config) {
    DeviceGeometry geometry;
    require_given(config, "name");
    geometry.name = config.text("name", "");
    const auto is_word = [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_';
    };
    if (geometry.name.empty() || !std::all_of(geometry.name.begin(), geometry.name.end(), is_word)) {
        config.fail("name", "must be a word of letters, digits, - and _");
    }
    require_given(config, "board");
    const std::string board = config.choice("board", kBoards.front(), {kBoards.begin(), kBoards.end()});
    geometry.board = static_cast<BoardKind>(std::find(kBoards.begin(), kBoards.end(), board) - kBoards.begin());
    read_tensions(config, geometry);
    if (geometry.board == BoardKind::Uart) {
        geometry.uart_boards = read_uart_boards(config);
    }
    read_strings(config, geometry);
    read_motor_channels(config, geometry);
    config.reject_unknown();
    if (!wrench_closure(geometry, {}).determined) {
        config.fail("string", "the eight lengths do not determine the pose of the grip: check motors and knots");
    }
    return geometry;
}

const BuiltInGeometry& find_built_in(std::string_view name) {
    std::string names;
    for (const BuiltInGeometry& one : built_in_geometries()) {
        if (one.name == name) {
            return one;
        }
        names += (names.empty() ? "" : ", ") + std::string(one.name);
    }
    throw std::invalid_argument("no built-in device geometry is named '" + std::string(name) +
                                "'; the built-in ones are " + names +
                                "; the path of a file must contain a slash or end in .toml");
}

std::string shown(double value) {
    // Shortest text that reads back to the same bits.
    std::array<char, 32> buffer{};
    const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
    const std::string text(buffer.data(), end);
    // TOML distinguishes the integer 20 from the float 20.0.
    return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}

std::string shown(const Vec3& v) {
    return "[" + shown(v.x) + ", " + shown(v.y) + ", " + shown(v.z) + "]";
}

}  // namespace

DeviceGeometry load_device_geometry(const std::filesystem::path& file) {
    const Config config = Config::load(file);
    DeviceGeometry geometry = read_device_geometry(config);
    note_old_names(config);
    return geometry;
}

DeviceGeometry parse_device_geometry(std::string_view toml, std::string_view name) {
    return read_device_geometry(Config::parse(toml, name));
}

DeviceGeometry built_in_geometry(std::string_view name) {
    const BuiltInGeometry& found = find_built_in(name);
    return parse_device_geometry(found.text, found.file);
}

std::vector<std::string> built_in_geometry_names() {
    std::vector<std::string> names;
    for (const BuiltInGeometry& one : built_in_geometries()) {
        names.emplace_back(one.name);
    }
    return names;
}

std::string_view built_in_geometry_text(std::string_view name) {
    return find_built_in(name).text;
}

DeviceGeometry find_device_geometry(const std::string& name_or_path) {
    const bool is_path = name_or_path.find('/') != std::string::npos || name_or_path.ends_with(".toml");
    return is_path ? load_device_geometry(name_or_path) : built_in_geometry(name_or_path);
}

std::string to_toml(const DeviceGeometry& geometry, std::string_view comment) {
    std::string text;
    for (std::size_t begin = 0; begin < comment.size();) {
        const std::size_t end = std::min(comment.find('\n', begin), comment.size());
        text += "# " + std::string(comment.substr(begin, end - begin)) + "\n";
        begin = end + 1;
    }
    text += (text.empty() ? "" : "\n");
    text += "name = \"" + geometry.name + "\"\nboard = \"" + kBoards[static_cast<std::size_t>(geometry.board)] + "\"\n";
    text += "minimum_tension = " + shown(geometry.minimum_tension) + "  # N\n";
    text += "maximum_tension = " + shown(geometry.maximum_tension) + "  # N\n";
    if (geometry.board == BoardKind::Uart) {
        std::string list;
        for (const int strings : geometry.uart_boards) {
            list += (list.empty() ? "" : ", ") + std::to_string(strings);
        }
        text += "uart_boards = [" + list + "]\n";
    }
    text += "\n[axes]\nx = \"right\"\ny = \"up\"\nz = \"toward\"\n";
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringFacts& string = geometry.strings[i];
        text += "\n[[string]]  # " + std::to_string(i) + "\n";
        text += "motor = " + shown(string.motor) + "  # m\n";
        text += "grip = " + shown(string.grip) + "  # m\n";
        text += "metres_per_count = " + shown(string.metres_per_count) + "  # m\n";
        text += "newtons_per_code = " + shown(string.newtons_per_code) + "  # N\n";
        if (geometry.motor_channels[i] != i) {
            text += "motor_channel = " + std::to_string(geometry.motor_channels[i]) + "\n";
        }
        if (string.continuous_tension > 0.0) {
            text += "continuous_tension = " + shown(string.continuous_tension) + "  # N\n";
        }
        if (string.thermal_time_constant_s > 0.0) {
            text += "thermal_time_constant_s = " + shown(string.thermal_time_constant_s) + "  # s\n";
        }
    }
    return text;
}

std::vector<DeviceGeometryWarning> warnings_of(const DeviceGeometry& geometry) {
    std::vector<DeviceGeometryWarning> warnings;
    const WrenchClosure closure = wrench_closure(geometry, {});
    if (!closure.closed()) {
        std::string missing;
        for (const std::string& axis : closure.missing) {
            missing += (missing.empty() ? "" : ", ") + axis;
        }
        warnings.push_back(
            {"not_wrench_closed",
             "strings that only pull cannot exert every wrench at the centre; the missing axes of force and "
             "torque are " +
                 missing + "; use this device only to measure poses"});
    }
    return warnings;
}

}  // namespace haptic::device
