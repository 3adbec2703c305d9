#include <haptic/device/variant_file.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <glm/geometric.hpp>
#include <iterator>
#include <numeric>
#include <stdexcept>

#include "geometry/builtin_variants.hpp"
#include <haptic/config.hpp>
#include <haptic/device/digits.hpp>
#include "geometry/wrench_closure.hpp"

namespace haptic::device {
namespace {

constexpr Range kCoordinate{-1.0, 1.0};        // m
constexpr Range kMetresPerCount{-1e-3, 1e-3};  // m
constexpr double kLeastMetresPerCount = 1e-8;
constexpr Range kNewtonsPerDigit{-1.0, 1.0};  // N
constexpr double kLeastNewtonsPerDigit = 1e-6;
constexpr Range kTension{0.0, 200.0};       // N
constexpr Range kThermalTime{0.0, 3600.0};  // s
constexpr double kShortest = 0.005;         // m, of a string at the centre: what is shorter is a mistake in the lists

constexpr std::array<const char*, 3> kBoards = {"sh4", "simple", "uart"};

/// Unit vector of a direction seen by the person in front of the device; z points toward that person.
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
constexpr std::array<const char*, 3> kUsualAxes = {"right", "up", "toward"};

/// Columns: where the lists' x, y and z point in the device frame. A signed permutation, so that no digit is lost.
Mat3 read_axes(const Config& config) {
    std::vector<std::string> names;
    names.reserve(kDirections.size());
    for (const NamedDirection& one : kDirections) {
        names.emplace_back(one.name);
    }
    Mat3 axes(0.0);
    for (int k = 0; k < 3; ++k) {
        const auto index = static_cast<std::size_t>(k);
        const std::string chosen = config.choice(kAxisKeys[index], kUsualAxes[index], names);
        const auto found = std::find_if(kDirections.begin(), kDirections.end(),
                                        [&](const NamedDirection& one) { return one.name == chosen; });
        axes[k] = Vec3(found->direction[0], found->direction[1], found->direction[2]);
        for (int before = 0; before < k; ++before) {
            if (glm::dot(axes[before], axes[k]) != 0.0) {
                config.fail(kAxisKeys[index], "lies along " + std::string(kAxisKeys[static_cast<std::size_t>(before)]) +
                                                  "; each of right/left, up/down and toward/away must be taken once");
            }
        }
    }
    return axes;
}

Vec3 read_point(const Config& config, const std::string& key, const Mat3& axes) {
    require_given(config, key);
    const Vec3 listed = config.vec3(key, {}, kCoordinate);
    return Vec3(0.0) + axes * listed;  // not -0 where an axis is turned round
}

/// A scale of a string: its own, or the one at the top.
double read_scale(const Config& config, const std::string& string, const std::string& name, Range range, double least) {
    const std::string own = string + "." + name;
    const double common = config.number(name, 0.0, range);
    if (!config.has(own) && !config.has(name)) {
        config.fail(own, "must be given, here or for all strings at the top of the file");
    }
    const double scale = config.number(own, common, range);
    if (std::fabs(scale) < least) {
        config.fail(config.has(own) ? own : name, "must not be zero, nor nearly so");
    }
    return scale;
}

/// A number of a string: its own, or the one at the top, or 0 for one that nobody knows.
double read_optional(const Config& config, const std::string& string, const std::string& name, Range range) {
    return config.number(string + "." + name, config.number(name, 0.0, range), range);
}

StringFacts read_string(const Config& config, const std::string& key, const Mat3& axes) {
    StringFacts string;
    string.motor = read_point(config, key + ".motor", axes);
    string.grip = read_point(config, key + ".grip", axes);
    string.metres_per_count = read_scale(config, key, "metres_per_count", kMetresPerCount, kLeastMetresPerCount);
    string.newtons_per_digit = read_scale(config, key, "newtons_per_digit", kNewtonsPerDigit, kLeastNewtonsPerDigit);
    string.continuous_tension = read_optional(config, key, "continuous_tension", kTension);
    string.thermal_time_constant_s = read_optional(config, key, "thermal_time_constant_s", kThermalTime);
    if (glm::length(string.motor - string.grip) < kShortest) {
        config.fail(key + ".motor", "is nearer than 5 mm to the knot on the grip: the string has no length");
    }
    return string;
}

void read_strings(const Config& config, Variant& variant) {
    const Mat3 axes = read_axes(config);
    const std::size_t count = config.tables("string");
    if (count != kStrings) {
        config.fail("string", "there must be exactly 8 tables [[string]], there are " + std::to_string(count));
    }
    for (std::size_t i = 0; i < kStrings; ++i) {
        const std::string key = "string." + std::to_string(i);
        variant.strings[i] = read_string(config, key, axes);
        const double most = kMaximumDigit * std::fabs(variant.strings[i].newtons_per_digit);
        if (most < variant.maximum_tension) {
            const std::string own = key + ".newtons_per_digit";
            config.fail(config.has(own) ? own : "newtons_per_digit",
                        "the largest digit, 4095, makes " + std::to_string(most) +
                            " N, less than maximum_tension: lower that, or correct this");
        }
    }
}

void read_tensions(const Config& config, Variant& variant) {
    variant.minimum_tension = required_number(config, "minimum_tension", kTension);
    variant.maximum_tension = required_number(config, "maximum_tension", kTension);
    if (!(variant.maximum_tension > variant.minimum_tension)) {
        config.fail("maximum_tension", "must be larger than minimum_tension");
    }
}

std::vector<int> read_uart_boards(const Config& config) {
    require_given(config, "uart_boards");
    const std::vector<double> counts = config.numbers("uart_boards", {}, {1, kStrings});
    const auto whole = [](double number) { return number == std::trunc(number); };
    if (!std::all_of(counts.begin(), counts.end(), whole) ||
        std::accumulate(counts.begin(), counts.end(), 0.0) != double(kStrings)) {
        config.fail("uart_boards", "must be a whole number of strings for each board, 8 together");
    }
    return {counts.begin(), counts.end()};
}

Variant read_variant(const Config& config) {
    Variant variant;
    require_given(config, "name");
    variant.name = config.text("name", "");
    const auto is_word = [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_';
    };
    if (variant.name.empty() || !std::all_of(variant.name.begin(), variant.name.end(), is_word)) {
        config.fail("name", "must be a word of letters, digits, - and _");
    }
    require_given(config, "board");
    const std::string board = config.choice("board", kBoards.front(), {kBoards.begin(), kBoards.end()});
    variant.board = static_cast<BoardKind>(std::find(kBoards.begin(), kBoards.end(), board) - kBoards.begin());
    read_tensions(config, variant);
    if (variant.board == BoardKind::Uart) {
        variant.uart_boards = read_uart_boards(config);
    }
    read_strings(config, variant);
    config.reject_unknown();
    if (!wrench_closure(variant, {}).determined) {
        config.fail("string", "the eight lengths do not determine where the grip is: check motors and knots");
    }
    return variant;
}

const BuiltInVariant& find_built_in(std::string_view name) {
    std::string names;
    for (const BuiltInVariant& one : built_in_variants()) {
        if (one.name == name) {
            return one;
        }
        names += (names.empty() ? "" : ", ") + std::string(one.name);
    }
    throw std::invalid_argument("no variant is named '" + std::string(name) + "'; built in are " + names +
                                "; a file is meant by a path with a slash, or one that ends in .toml");
}

std::string shown(double value) {
    std::array<char, 32> digits{};
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
    const std::string text(digits.data(), end);
    // TOML tells 20 from 20.0.
    return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}

std::string shown(const Vec3& v) {
    return "[" + shown(v.x) + ", " + shown(v.y) + ", " + shown(v.z) + "]";
}

}  // namespace

Variant load_variant(const std::filesystem::path& file) {
    return read_variant(Config::load(file));
}

Variant parse_variant(std::string_view toml, std::string_view name) {
    return read_variant(Config::parse(toml, name));
}

Variant builtin_variant(std::string_view name) {
    const BuiltInVariant& found = find_built_in(name);
    return parse_variant(found.text, found.file);
}

std::vector<std::string> builtin_variant_names() {
    std::vector<std::string> names;
    for (const BuiltInVariant& one : built_in_variants()) {
        names.emplace_back(one.name);
    }
    return names;
}

std::string_view builtin_variant_text(std::string_view name) {
    return find_built_in(name).text;
}

Variant find_variant(const std::string& name_or_path) {
    const bool is_path = name_or_path.find('/') != std::string::npos || name_or_path.ends_with(".toml");
    return is_path ? load_variant(name_or_path) : builtin_variant(name_or_path);
}

std::string to_toml(const Variant& variant, std::string_view comment) {
    std::string text;
    for (std::size_t begin = 0; begin < comment.size();) {
        const std::size_t end = std::min(comment.find('\n', begin), comment.size());
        text += "# " + std::string(comment.substr(begin, end - begin)) + "\n";
        begin = end + 1;
    }
    text += (text.empty() ? "" : "\n");
    text += "name = \"" + variant.name + "\"\nboard = \"" + kBoards[static_cast<std::size_t>(variant.board)] + "\"\n";
    text += "minimum_tension = " + shown(variant.minimum_tension) + "  # N\n";
    text += "maximum_tension = " + shown(variant.maximum_tension) + "  # N\n";
    if (variant.board == BoardKind::Uart) {
        std::string list;
        for (const int strings : variant.uart_boards) {
            list += (list.empty() ? "" : ", ") + std::to_string(strings);
        }
        text += "uart_boards = [" + list + "]\n";
    }
    text += "\n[axes]\nx = \"right\"\ny = \"up\"\nz = \"toward\"\n";
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringFacts& string = variant.strings[i];
        text += "\n[[string]]  # " + std::to_string(i) + "\n";
        text += "motor = " + shown(string.motor) + "  # m\n";
        text += "grip = " + shown(string.grip) + "  # m\n";
        text += "metres_per_count = " + shown(string.metres_per_count) + "  # m\n";
        text += "newtons_per_digit = " + shown(string.newtons_per_digit) + "  # N\n";
        if (string.continuous_tension > 0.0) {
            text += "continuous_tension = " + shown(string.continuous_tension) + "  # N\n";
        }
        if (string.thermal_time_constant_s > 0.0) {
            text += "thermal_time_constant_s = " + shown(string.thermal_time_constant_s) + "  # s\n";
        }
    }
    return text;
}

std::vector<VariantWarning> warnings_of(const Variant& variant) {
    std::vector<VariantWarning> warnings;
    const WrenchClosure closure = wrench_closure(variant, {});
    if (!closure.closed()) {
        std::string missing;
        for (const std::string& axis : closure.missing) {
            missing += (missing.empty() ? "" : ", ") + axis;
        }
        warnings.push_back({"not_wrench_closed",
                            "pulling strings cannot make every wrench at the centre: of the axes of force and torque "
                            "not " +
                                missing + "; use it for measuring poses"});
    }
    return warnings;
}

}  // namespace haptic::device
