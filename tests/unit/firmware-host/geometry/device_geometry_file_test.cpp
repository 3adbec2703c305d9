#include "haptic/device/device_geometry_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>

#include "haptic/config.hpp"

namespace haptic::device {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;
using testing::ThrowsMessage;

const std::filesystem::path kFolder = GEOMETRIES;

std::string x3r_text() {
    return std::string(built_in_geometry_text("SpidarG6X3R"));
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
    const std::size_t at = text.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    return text.replace(at, what.size(), by);
}

std::string without(const std::string& text, const std::string& what) {
    return replaced(text, what, "");
}

void expect_refused(const std::string& text, const testing::Matcher<const std::string&>& message) {
    EXPECT_THAT([&] { (void)parse_device_geometry(text, "device.toml"); }, ThrowsMessage<ConfigError>(message));
}

struct PublishedString {
    Vec3 motor;
    Vec3 grip;
    int count;     // sign
    int dac_code;  // sign
};

struct Table {
    const char* name;
    BoardKind board;
    double metres_per_count;
    double volts_per_newton;
    double codes_per_volt;
    double minimum;
    double maximum;
    bool away;  // z of the rows points away from the user
    std::array<PublishedString, kStrings> rows;
};

// As published, in mm, entered independently of the files.
const std::array<Table, 3> kTables = {{{"SpidarG6X4",
                                        BoardKind::Uart,
                                        3.485e-5,
                                        0.08,
                                        4096.0 / 3.3,
                                        0.2,
                                        20.0,
                                        true,
                                        {{{{69, -95, -69}, {0, -22.5, 0}, -1, +1},
                                          {{69, -95, 69}, {22.5, 0, 0}, -1, +1},
                                          {{-69, -95, 69}, {-22.5, 0, 0}, +1, -1},
                                          {{-69, -95, -69}, {0, -22.5, 0}, +1, -1},
                                          {{69, 95, -69}, {0, 22.5, 0}, +1, -1},
                                          {{69, 95, 69}, {22.5, 0, 0}, +1, -1},
                                          {{-69, 95, 69}, {-22.5, 0, 0}, -1, +1},
                                          {{-69, 95, -69}, {0, 22.5, 0}, -1, +1}}}},
                                       {"SpidarG6X5R",
                                        BoardKind::Uart,
                                        2.25e-5,
                                        0.091,
                                        4096.0 / 3.3,
                                        0.3,
                                        6.0,
                                        true,
                                        {{{{-77.5, -73.5, 77.5}, {-15, 0, 0}, -1, +1},
                                          {{77.5, -73.5, 77.5}, {15, 0, 0}, +1, -1},
                                          {{77.5, -73.5, -77.5}, {0, -15, 0}, -1, +1},
                                          {{-77.5, -73.5, -77.5}, {0, -15, 0}, +1, -1},
                                          {{-77.5, 73.5, 77.5}, {-15, 0, 0}, -1, +1},
                                          {{77.5, 73.5, 77.5}, {15, 0, 0}, +1, -1},
                                          {{77.5, 73.5, -77.5}, {0, 15, 0}, -1, +1},
                                          {{-77.5, 73.5, -77.5}, {0, 15, 0}, +1, -1}}}},
                                       {"SpidarG6X3F",
                                        BoardKind::Sh4,
                                        1.66555e-5,
                                        0.365296803653,
                                        415.0,
                                        0.3,
                                        20.0,
                                        true,
                                        {{{{-60, -73, 60}, {-16, 0, 0}, +1, +1},
                                          {{60, -73, 60}, {0, 0, 16}, +1, +1},
                                          {{60, -73, -60}, {16, 0, 0}, -1, +1},
                                          {{-60, -73, -60}, {0, 0, -16}, -1, +1},
                                          {{-60, 73, 60}, {-16, 0, 0}, -1, +1},
                                          {{60, 73, 60}, {0, 0, 16}, -1, +1},
                                          {{60, 73, -60}, {16, 0, 0}, +1, +1},
                                          {{-60, 73, -60}, {0, 0, -16}, +1, +1}}}}}};

TEST(DeviceGeometryFile, BuiltInGeometriesHaveThePublishedNumbers) {
    for (const Table& table : kTables) {
        SCOPED_TRACE(table.name);
        const DeviceGeometry geometry = built_in_geometry(table.name);
        EXPECT_EQ(geometry.board, table.board);
        EXPECT_EQ(geometry.minimum_tension, table.minimum);
        EXPECT_EQ(geometry.maximum_tension, table.maximum);
        const Vec3 to_metres = Vec3(1e-3, 1e-3, table.away ? -1e-3 : 1e-3);
        for (std::size_t i = 0; i < kStrings; ++i) {
            SCOPED_TRACE(i);
            EXPECT_LT(glm::length(geometry.strings[i].motor - table.rows[i].motor * to_metres), 1e-15);
            EXPECT_LT(glm::length(geometry.strings[i].grip - table.rows[i].grip * to_metres), 1e-15);
            EXPECT_EQ(geometry.strings[i].metres_per_count, table.rows[i].count * table.metres_per_count);
            EXPECT_DOUBLE_EQ(geometry.strings[i].newtons_per_code,
                             table.rows[i].dac_code / (table.volts_per_newton * table.codes_per_volt));
        }
    }
}

TEST(DeviceGeometryFile, X3lIsX3rTurnedByHalfATurnAboutZ) {
    const DeviceGeometry right = built_in_geometry("SpidarG6X3R");
    const DeviceGeometry left = built_in_geometry("SpidarG6X3L");
    for (std::size_t i = 0; i < kStrings; ++i) {
        EXPECT_EQ(left.strings[i].motor, right.strings[i].motor * Vec3(-1, -1, 1));
        EXPECT_EQ(left.strings[i].grip, right.strings[i].grip * Vec3(-1, -1, 1));
        EXPECT_EQ(left.strings[i].metres_per_count, right.strings[i].metres_per_count);
        EXPECT_EQ(left.strings[i].newtons_per_code, right.strings[i].newtons_per_code);
    }
}

TEST(DeviceGeometryFile, X5lIsX5rTurnedByHalfATurnAboutADiagonal) {
    const DeviceGeometry right = built_in_geometry("SpidarG6X5R");
    const DeviceGeometry left = built_in_geometry("SpidarG6X5L");
    // (x, y, z) -> (z, -y, x) with z away; with z toward the user that is (-z, -y, -x).
    const auto turned = [](const Vec3& v) { return Vec3(-v.z, -v.y, -v.x); };
    for (std::size_t i = 0; i < kStrings; ++i) {
        EXPECT_EQ(left.strings[i].motor, turned(right.strings[i].motor) + Vec3(0.0));
        EXPECT_EQ(left.strings[i].grip, turned(right.strings[i].grip) + Vec3(0.0));
        EXPECT_GT(left.strings[i].metres_per_count, 0.0);
    }
}

TEST(DeviceGeometryFile, T1HasTheWidthThatWasMeant) {
    const DeviceGeometry geometry = built_in_geometry("SpidarG6T1");
    EXPECT_NEAR(geometry.strings[3].motor.x - geometry.strings[0].motor.x, 0.229, 1e-15);
    EXPECT_NEAR(geometry.strings[2].motor.x - geometry.strings[1].motor.x, 0.155, 1e-15);
    EXPECT_THAT(std::string(built_in_geometry_text("SpidarG6T1")), AllOf(HasSubstr("0.229"), HasSubstr("0.074155")));
}

TEST(DeviceGeometryFile, RestLengthsAreThePublishedOnes) {
    const struct {
        const char* name;
        std::array<double, kStrings> mm;
    } cases[] = {
        {"SpidarG6X3L", {103.838, 103.838, 100.311, 100.311, 103.838, 103.838, 100.311, 100.311}},
        {"SpidarG6X3F", {104.235, 104.235, 104.235, 104.235, 104.235, 104.235, 104.235, 104.235}},
        {"SpidarG6X4", {121.566, 126.286, 126.286, 121.566, 121.566, 126.286, 126.286, 121.566}},
        {"SpidarG6X5R", {123.753, 123.753, 124.237, 124.237, 123.753, 123.753, 124.237, 124.237}},
    };
    for (const auto& [name, mm] : cases) {
        const DeviceGeometry geometry = built_in_geometry(name);
        for (std::size_t i = 0; i < kStrings; ++i) {
            EXPECT_NEAR(1e3 * geometry.rest_length(i), mm[i], 6e-4) << name << " " << i;
        }
    }
}

TEST(DeviceGeometryFile, EveryFileIsBuiltInUnderItsNameAndLoads) {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(kFolder)) {
        const DeviceGeometry geometry = load_device_geometry(entry.path());
        names.push_back(geometry.name);
        EXPECT_EQ(geometry, built_in_geometry(geometry.name));
        std::stringstream text;
        text << std::ifstream(entry.path()).rdbuf();
        EXPECT_EQ(text.str(), built_in_geometry_text(geometry.name));
    }
    EXPECT_THAT(names, testing::UnorderedElementsAreArray(built_in_geometry_names()));
    EXPECT_THAT(built_in_geometry_names(), testing::IsSupersetOf({"SpidarG6X3R", "SpidarG6X3L", "SpidarG6X3F",
                                                                  "SpidarG6X4", "SpidarG6X5R", "SpidarG6T1"}));
}

TEST(DeviceGeometryFile, WhatIsWrittenIsReadBackToTheSameBits) {
    for (const std::string& name : built_in_geometry_names()) {
        DeviceGeometry geometry = built_in_geometry(name);
        geometry.strings[2].newtons_per_code *= 1.0 / 3.0;  // as a calibration would
        geometry.strings[5].metres_per_count *= 1.0 + 1e-3 / 7.0;
        geometry.strings[6].grip += Vec3(1e-5 / 3.0);
        geometry.maximum_tension /= 3.0;
        std::swap(geometry.motor_channels[0], geometry.motor_channels[4]);
        const std::string text = to_toml(geometry, "of 2026-11-20\nsecond line");
        EXPECT_THAT(text, StartsWith("# of 2026-11-20\n# second line\n\nname = "));
        EXPECT_EQ(parse_device_geometry(text, "copy.toml"), geometry) << text;
    }
}

TEST(DeviceGeometryFile, EachMotorHasAChannelOfItsOwn) {
    DeviceGeometry geometry = built_in_geometry("SpidarG6X3R");
    geometry.motor_channels = {0, 1, 2, 3, 3, 5, 6, 7};
    expect_refused(to_toml(geometry, ""), HasSubstr("motor_channel: channel 3 drives another motor already"));
    geometry.motor_channels = {8, 1, 2, 3, 4, 5, 6, 7};
    expect_refused(to_toml(geometry, ""), HasSubstr("motor_channel: must be"));
}

TEST(DeviceGeometryFile, AxesMapTheListsIntoTheDeviceFrame) {
    // Each choice of axes is a signed permutation; the point (1, 2, 3) cm of the list identifies it.
    const std::string text = replaced(x3r_text(), "grip = [0.0, 0.0225, 0.0]", "grip = [0.01, 0.02, 0.03]");
    const struct {
        const char* x;
        const char* y;
        const char* z;
        Vec3 cm;
    } cases[] = {{"right", "up", "toward", {1, 2, 3}},    {"right", "up", "away", {1, 2, -3}},
                 {"left", "up", "away", {-1, 2, -3}},     {"toward", "up", "right", {3, 2, 1}},
                 {"up", "toward", "right", {3, 1, 2}},    {"down", "left", "away", {-2, -1, -3}},
                 {"right", "down", "toward", {1, -2, 3}}, {"away", "right", "down", {2, -3, -1}}};
    for (const auto& [x, y, z, cm] : cases) {
        std::string axes = replaced(text, "x = \"right\"", std::string("x = \"") + x + "\"");
        axes = replaced(axes, "y = \"up\"", std::string("y = \"") + y + "\"");
        axes = replaced(axes, "z = \"away\"", std::string("z = \"") + z + "\"");
        EXPECT_LT(glm::length(parse_device_geometry(axes, "a").strings[6].grip - 0.01 * cm), 1e-17) << x << y << z;
    }
    expect_refused(replaced(text, "y = \"up\"", "y = \"left\""),
                   HasSubstr("axes.y: is parallel to axes.x; use each of right/left, up/down and toward/away"));
    expect_refused(replaced(text, "z = \"away\"", "z = \"far\""), HasSubstr("axes.z: must be one of"));
}

TEST(DeviceGeometryFile, ScalesOfAStringReplaceTheCommonOnes) {
    const std::string text =
        replaced(x3r_text(), "[[string]]  # 1: lower far\n", "[[string]]\nnewtons_per_code = -0.007\n");
    const DeviceGeometry geometry = parse_device_geometry(text, "calibrated.toml");
    EXPECT_EQ(geometry.strings[1].newtons_per_code, -0.007);
    EXPECT_EQ(geometry.strings[0].newtons_per_code, spidar_g6_x3r().strings[0].newtons_per_code);
    const std::string bare = without(x3r_text(), "metres_per_count = 1.66555e-5");
    expect_refused(bare, AllOf(HasSubstr("string.0.metres_per_count: must be given"), HasSubstr("at the top")));
}

TEST(DeviceGeometryFile, AcceptsTheFormerNameOfNewtonsPerCode) {
    const std::string former = replaced(x3r_text(), "newtons_per_code = 0.00659", "newtons_per_digit = 0.00659");
    EXPECT_EQ(parse_device_geometry(former, "former.toml"), spidar_g6_x3r());
    // A string's own value, under either name, replaces the common one under the other.
    const std::string own =
        replaced(x3r_text(), "[[string]]  # 1: lower far\n", "[[string]]\nnewtons_per_digit = -0.007\n");
    EXPECT_EQ(parse_device_geometry(own, "former.toml").strings[1].newtons_per_code, -0.007);
    expect_refused(
        replaced(own, "newtons_per_digit", "newtons_per_code = -0.007\nnewtons_per_digit"),
        HasSubstr("string.1.newtons_per_digit: is the former name of newtons_per_code, which is given as well"));
}

TEST(DeviceGeometryFile, RefusesWhatIsMissingWithThePlace) {
    expect_refused(without(x3r_text(), "name = \"SpidarG6X3R\""), HasSubstr("device.toml: name: must be given"));
    expect_refused(replaced(x3r_text(), "board = \"sh4\"", ""), HasSubstr("board: must be given"));
    expect_refused(without(x3r_text(), "minimum_tension = 0.3"), HasSubstr("minimum_tension: must be given"));
    expect_refused(without(x3r_text(), "maximum_tension = 20.0"), HasSubstr("maximum_tension: must be given"));
    const std::string no_grip = replaced(x3r_text(), "\ngrip = [0.0, 0.0225, 0.0]", "\n");
    expect_refused(no_grip, testing::MatchesRegex("device.toml:[0-9]+: string.6.grip: must be given"));
    const std::size_t last = x3r_text().rfind("[[string]]");
    expect_refused(x3r_text().substr(0, last), HasSubstr("exactly 8 tables [[string]] are required, the file has 7"));
    expect_refused(x3r_text() + "\n[[string]]\n", HasSubstr("the file has 9"));
    expect_refused("", HasSubstr("must be given"));
}

TEST(DeviceGeometryFile, RefusesValuesThatCannotBe) {
    const std::string good = x3r_text();
    expect_refused(replaced(good, "0.3  ", "nan  "), HasSubstr("minimum_tension: must be a finite number"));
    expect_refused(replaced(good, "0.3  ", "30.0 "), HasSubstr("maximum_tension: must be larger than minimum_tension"));
    expect_refused(
        replaced(good, "20.0  ", "27.1  "),
        AllOf(HasSubstr("newtons_per_code: the largest DAC code, 4095, gives 27.01"), HasSubstr("device.toml:")));
    expect_refused(replaced(good, "metres_per_count = 1.66555e-5", "metres_per_count = 0.0"),
                   HasSubstr("metres_per_count: must not be zero"));
    expect_refused(replaced(good, "newtons_per_code = 0.00659", "newtons_per_code = 0.0 #"),
                   HasSubstr("newtons_per_code: must not be zero"));
    expect_refused(replaced(good, "[0.0, -0.0225, 0.0]", "[0.0, inf, 0.0]"),
                   HasSubstr("string.2.grip: must be a finite number"));
    expect_refused(replaced(good, "[0.0, -0.0225, 0.0]", "[0.0, -22.5, 0.0]"),
                   HasSubstr("string.2.grip: must be within [-1, 1]"));
    expect_refused(replaced(good, "[0.0, -0.0225, 0.0]", "[0.0, -0.0225]"), HasSubstr("must have 3 numbers"));
    expect_refused(replaced(good, "[0.0, -0.0225, 0.0]", "[0.08485281374238571, -0.075, 0.0]"),
                   HasSubstr("string.2.motor: is less than 5 mm"));
    expect_refused(replaced(good, "\"sh4\"", "\"h8\""),
                   HasSubstr("board: must be one of \"sh4\", \"simple\", \"uart\""));
    expect_refused(replaced(good, "\"SpidarG6X3R\"", "\"a b\""), HasSubstr("name: must be a word"));
    expect_refused(replaced(good, "[axes]", "[axis]"), HasSubstr("unknown key"));
    expect_refused(replaced(good, "[axes]", "[axes"), HasSubstr("not valid TOML"));
}

TEST(DeviceGeometryFile, RefusesStringsThatDoNotDetermineThePose) {
    std::string text = x3r_text();
    for (std::size_t at = text.find("grip = ["); at != std::string::npos; at = text.find("grip = [", at + 1)) {
        text.replace(at, text.find(']', at) + 1 - at, "grip = [0.0, 0.0225, 0.0]");
    }
    expect_refused(text, HasSubstr("string: the eight lengths do not determine the pose of the grip"));
}

TEST(DeviceGeometryFile, UartBoardsShareTheStrings) {
    EXPECT_THAT(built_in_geometry("SpidarG6X4").uart_boards, ElementsAre(4, 4));
    EXPECT_THAT(built_in_geometry("SpidarG6X5R").uart_boards, ElementsAre(8));
    EXPECT_THAT(built_in_geometry("SpidarG6X3R").uart_boards, IsEmpty());
    const std::string good(built_in_geometry_text("SpidarG6X4"));
    EXPECT_THAT(parse_device_geometry(replaced(good, "[4, 4]", "[1, 2, 5]"), "x").uart_boards, ElementsAre(1, 2, 5));
    expect_refused(replaced(good, "[4, 4]", "[4, 5]"), HasSubstr("uart_boards: must be an integer number"));
    expect_refused(replaced(good, "[4, 4]", "[7.5, 0.5]"), HasSubstr("uart_boards: must be within [1, 8]"));
    expect_refused(replaced(good, "[4, 4]", "[6.5, 1.5]"), HasSubstr("8 in total"));
    expect_refused(replaced(good, "[4, 4]", "[]"), HasSubstr("8 in total"));
    expect_refused(replaced(good, "uart_boards =", "#"), HasSubstr("uart_boards: must be given"));
    expect_refused(replaced(good, "\"uart\"", "\"sh4\""), HasSubstr("unknown key"));
}

TEST(DeviceGeometryFile, WhatTheMotorsBearMayBeSaidForAllOrForOne) {
    EXPECT_EQ(spidar_g6_x3r().strings[4].continuous_tension, 0.0) << "not known";
    const std::string text =
        replaced(x3r_text(), "[axes]", "continuous_tension = 4.0\nthermal_time_constant_s = 30.0\n[axes]");
    const DeviceGeometry geometry = parse_device_geometry(
        replaced(text, "[[string]]  # 7: upper near\n", "[[string]]\ncontinuous_tension = 2.5\n"), "x");
    EXPECT_EQ(geometry.strings[6].continuous_tension, 4.0);
    EXPECT_EQ(geometry.strings[7].continuous_tension, 2.5);
    EXPECT_EQ(geometry.strings[7].thermal_time_constant_s, 30.0);
    EXPECT_EQ(parse_device_geometry(to_toml(geometry, ""), "copy"), geometry);
    expect_refused(replaced(text, "= 4.0", "= -4.0"), HasSubstr("continuous_tension: must be within [0, 200]"));
}

TEST(DeviceGeometryFile, FindsBuiltInNamesAndPaths) {
    EXPECT_EQ(find_device_geometry("SpidarG6X4").name, "SpidarG6X4");
    EXPECT_EQ(find_device_geometry((kFolder / "x4.toml").string()), built_in_geometry("SpidarG6X4"));
    EXPECT_THAT([] { (void)find_device_geometry("X4"); },
                ThrowsMessage<std::invalid_argument>(AllOf(HasSubstr("'X4'"), HasSubstr("SpidarG6X4"))));
    EXPECT_THAT([] { (void)find_device_geometry("nowhere.toml"); },
                ThrowsMessage<ConfigError>(HasSubstr("nowhere.toml")));
}

TEST(DeviceGeometryFile, WarnsOfFramesThatAreNotWrenchClosedByName) {
    for (const std::string& name : built_in_geometry_names()) {
        const std::vector<DeviceGeometryWarning> warnings = warnings_of(built_in_geometry(name));
        if (name == "SpidarG6X3F" || name == "SpidarG6T1") {
            ASSERT_EQ(warnings.size(), 1u) << name;
            EXPECT_EQ(warnings[0].name, "not_wrench_closed");
        } else {
            EXPECT_THAT(warnings, IsEmpty()) << name;
        }
    }
}

}  // namespace
}  // namespace haptic::device
