#include <haptic/device/variant_file.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>

#include <haptic/config.hpp>

namespace haptic::device {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;
using testing::ThrowsMessage;

const std::filesystem::path kFolder = VARIANTS;

std::string x3r_text() {
    return std::string(builtin_variant_text("SpidarG6X3R"));
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
    EXPECT_THAT([&] { (void)parse_variant(text, "frame.toml"); }, ThrowsMessage<ConfigError>(message));
}

struct Row {
    Vec3 motor;
    Vec3 grip;
    int count;  // sign
    int digit;  // sign
};

struct Table {
    const char* name;
    BoardKind board;
    double metres_per_count;
    double volts_per_newton;
    double digits_per_volt;
    double minimum;
    double maximum;
    bool away;  // z of the rows is away from the person
    std::array<Row, kStrings> rows;
};

// As published, in mm, typed in apart from the files.
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

TEST(VariantFile, BuiltInVariantsHaveThePublishedNumbers) {
    for (const Table& table : kTables) {
        SCOPED_TRACE(table.name);
        const Variant variant = builtin_variant(table.name);
        EXPECT_EQ(variant.board, table.board);
        EXPECT_EQ(variant.minimum_tension, table.minimum);
        EXPECT_EQ(variant.maximum_tension, table.maximum);
        const Vec3 to_metres = Vec3(1e-3, 1e-3, table.away ? -1e-3 : 1e-3);
        for (std::size_t i = 0; i < kStrings; ++i) {
            SCOPED_TRACE(i);
            EXPECT_LT(glm::length(variant.strings[i].motor - table.rows[i].motor * to_metres), 1e-15);
            EXPECT_LT(glm::length(variant.strings[i].grip - table.rows[i].grip * to_metres), 1e-15);
            EXPECT_EQ(variant.strings[i].metres_per_count, table.rows[i].count * table.metres_per_count);
            EXPECT_DOUBLE_EQ(variant.strings[i].newtons_per_digit,
                             table.rows[i].digit / (table.volts_per_newton * table.digits_per_volt));
        }
    }
}

TEST(VariantFile, X3lIsX3rTurnedByHalfATurnAboutZ) {
    const Variant right = builtin_variant("SpidarG6X3R");
    const Variant left = builtin_variant("SpidarG6X3L");
    for (std::size_t i = 0; i < kStrings; ++i) {
        EXPECT_EQ(left.strings[i].motor, right.strings[i].motor * Vec3(-1, -1, 1));
        EXPECT_EQ(left.strings[i].grip, right.strings[i].grip * Vec3(-1, -1, 1));
        EXPECT_EQ(left.strings[i].metres_per_count, right.strings[i].metres_per_count);
        EXPECT_EQ(left.strings[i].newtons_per_digit, right.strings[i].newtons_per_digit);
    }
}

TEST(VariantFile, X5lIsX5rTurnedByHalfATurnAboutADiagonal) {
    const Variant right = builtin_variant("SpidarG6X5R");
    const Variant left = builtin_variant("SpidarG6X5L");
    // (x, y, z) -> (z, -y, x) with z away; with z toward the person that is (-z, -y, -x).
    const auto turned = [](const Vec3& v) { return Vec3(-v.z, -v.y, -v.x); };
    for (std::size_t i = 0; i < kStrings; ++i) {
        EXPECT_EQ(left.strings[i].motor, turned(right.strings[i].motor) + Vec3(0.0));
        EXPECT_EQ(left.strings[i].grip, turned(right.strings[i].grip) + Vec3(0.0));
        EXPECT_GT(left.strings[i].metres_per_count, 0.0);
    }
}

TEST(VariantFile, T1HasTheWidthThatWasMeant) {
    const Variant variant = builtin_variant("SpidarG6T1");
    EXPECT_NEAR(variant.strings[3].motor.x - variant.strings[0].motor.x, 0.229, 1e-15);
    EXPECT_NEAR(variant.strings[2].motor.x - variant.strings[1].motor.x, 0.155, 1e-15);
    EXPECT_THAT(std::string(builtin_variant_text("SpidarG6T1")), AllOf(HasSubstr("0.229"), HasSubstr("0.074155")));
}

TEST(VariantFile, RestLengthsAreThePublishedOnes) {
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
        const Variant variant = builtin_variant(name);
        for (std::size_t i = 0; i < kStrings; ++i) {
            EXPECT_NEAR(1e3 * variant.rest_length(i), mm[i], 6e-4) << name << " " << i;
        }
    }
}

TEST(VariantFile, EveryFileIsBuiltInUnderItsNameAndLoads) {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(kFolder)) {
        const Variant variant = load_variant(entry.path());
        names.push_back(variant.name);
        EXPECT_EQ(variant, builtin_variant(variant.name));
        std::stringstream text;
        text << std::ifstream(entry.path()).rdbuf();
        EXPECT_EQ(text.str(), builtin_variant_text(variant.name));
    }
    EXPECT_THAT(names, testing::UnorderedElementsAreArray(builtin_variant_names()));
    EXPECT_THAT(builtin_variant_names(), testing::IsSupersetOf({"SpidarG6X3R", "SpidarG6X3L", "SpidarG6X3F",
                                                                "SpidarG6X4", "SpidarG6X5R", "SpidarG6T1"}));
}

TEST(VariantFile, WhatIsWrittenIsReadBackToTheSameBits) {
    for (const std::string& name : builtin_variant_names()) {
        Variant variant = builtin_variant(name);
        variant.strings[2].newtons_per_digit *= 1.0 / 3.0;  // as a calibration would
        variant.strings[5].metres_per_count *= 1.0 + 1e-3 / 7.0;
        variant.strings[6].grip += Vec3(1e-5 / 3.0);
        variant.maximum_tension /= 3.0;
        const std::string text = to_toml(variant, "of 2026-11-20\nsecond line");
        EXPECT_THAT(text, StartsWith("# of 2026-11-20\n# second line\n\nname = "));
        EXPECT_EQ(parse_variant(text, "copy.toml"), variant) << text;
    }
}

TEST(VariantFile, AxesMapTheListsIntoTheDeviceFrame) {
    // Each choice of axes is a signed permutation; the point (1, 2, 3) cm of the list says which.
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
        EXPECT_LT(glm::length(parse_variant(axes, "a").strings[6].grip - 0.01 * cm), 1e-17) << x << y << z;
    }
    expect_refused(replaced(text, "y = \"up\"", "y = \"left\""),
                   HasSubstr("axes.y: lies along axes.x; each of right/left, up/down and toward/away"));
    expect_refused(replaced(text, "z = \"away\"", "z = \"far\""), HasSubstr("axes.z: must be one of"));
}

TEST(VariantFile, ScalesOfAStringReplaceTheCommonOnes) {
    const std::string text =
        replaced(x3r_text(), "[[string]]  # 1: lower far\n", "[[string]]\nnewtons_per_digit = -0.007\n");
    const Variant variant = parse_variant(text, "calibrated.toml");
    EXPECT_EQ(variant.strings[1].newtons_per_digit, -0.007);
    EXPECT_EQ(variant.strings[0].newtons_per_digit, spidar_g6_x3r().strings[0].newtons_per_digit);
    const std::string bare = without(x3r_text(), "metres_per_count = 1.66555e-5");
    expect_refused(bare, AllOf(HasSubstr("string.0.metres_per_count: must be given"), HasSubstr("at the top")));
}

TEST(VariantFile, RefusesWhatIsMissingWithThePlace) {
    expect_refused(without(x3r_text(), "name = \"SpidarG6X3R\""), HasSubstr("frame.toml: name: must be given"));
    expect_refused(replaced(x3r_text(), "board = \"sh4\"", ""), HasSubstr("board: must be given"));
    expect_refused(without(x3r_text(), "minimum_tension = 0.3"), HasSubstr("minimum_tension: must be given"));
    expect_refused(without(x3r_text(), "maximum_tension = 20.0"), HasSubstr("maximum_tension: must be given"));
    const std::string no_grip = replaced(x3r_text(), "\ngrip = [0.0, 0.0225, 0.0]", "\n");
    expect_refused(no_grip, testing::MatchesRegex("frame.toml:[0-9]+: string.6.grip: must be given"));
    const std::size_t last = x3r_text().rfind("[[string]]");
    expect_refused(x3r_text().substr(0, last), HasSubstr("must be exactly 8 tables [[string]], there are 7"));
    expect_refused(x3r_text() + "\n[[string]]\n", HasSubstr("there are 9"));
    expect_refused("", HasSubstr("must be given"));
}

TEST(VariantFile, RefusesValuesThatCannotBe) {
    const std::string good = x3r_text();
    expect_refused(replaced(good, "0.3  ", "nan  "), HasSubstr("minimum_tension: must be a finite number"));
    expect_refused(replaced(good, "0.3  ", "30.0 "), HasSubstr("maximum_tension: must be larger than minimum_tension"));
    expect_refused(
        replaced(good, "20.0  ", "27.1  "),
        AllOf(HasSubstr("newtons_per_digit: the largest digit, 4095, makes 27.01"), HasSubstr("frame.toml:")));
    expect_refused(replaced(good, "metres_per_count = 1.66555e-5", "metres_per_count = 0.0"),
                   HasSubstr("metres_per_count: must not be zero"));
    expect_refused(replaced(good, "newtons_per_digit = 0.00659", "newtons_per_digit = 0.0 #"),
                   HasSubstr("newtons_per_digit: must not be zero"));
    expect_refused(replaced(good, "[0.0, -0.0225, 0.0]", "[0.0, inf, 0.0]"),
                   HasSubstr("string.2.grip: must be a finite number"));
    expect_refused(replaced(good, "[0.0, -0.0225, 0.0]", "[0.0, -22.5, 0.0]"),
                   HasSubstr("string.2.grip: must be within [-1, 1]"));
    expect_refused(replaced(good, "[0.0, -0.0225, 0.0]", "[0.0, -0.0225]"), HasSubstr("must have 3 numbers"));
    expect_refused(replaced(good, "[0.0, -0.0225, 0.0]", "[0.08485281374238571, -0.075, 0.0]"),
                   HasSubstr("string.2.motor: is nearer than 5 mm"));
    expect_refused(replaced(good, "\"sh4\"", "\"h8\""),
                   HasSubstr("board: must be one of \"sh4\", \"simple\", \"uart\""));
    expect_refused(replaced(good, "\"SpidarG6X3R\"", "\"a b\""), HasSubstr("name: must be a word"));
    expect_refused(replaced(good, "[axes]", "[axis]"), HasSubstr("unknown key"));
    expect_refused(replaced(good, "[axes]", "[axes"), HasSubstr("not valid TOML"));
}

TEST(VariantFile, RefusesStringsThatDoNotDetermineThePose) {
    std::string text = x3r_text();
    for (std::size_t at = text.find("grip = ["); at != std::string::npos; at = text.find("grip = [", at + 1)) {
        text.replace(at, text.find(']', at) + 1 - at, "grip = [0.0, 0.0225, 0.0]");
    }
    expect_refused(text, HasSubstr("string: the eight lengths do not determine where the grip is"));
}

TEST(VariantFile, UartBoardsShareTheStrings) {
    EXPECT_THAT(builtin_variant("SpidarG6X4").uart_boards, ElementsAre(4, 4));
    EXPECT_THAT(builtin_variant("SpidarG6X5R").uart_boards, ElementsAre(8));
    EXPECT_THAT(builtin_variant("SpidarG6X3R").uart_boards, IsEmpty());
    const std::string good(builtin_variant_text("SpidarG6X4"));
    EXPECT_THAT(parse_variant(replaced(good, "[4, 4]", "[1, 2, 5]"), "x").uart_boards, ElementsAre(1, 2, 5));
    expect_refused(replaced(good, "[4, 4]", "[4, 5]"), HasSubstr("uart_boards: must be a whole number"));
    expect_refused(replaced(good, "[4, 4]", "[7.5, 0.5]"), HasSubstr("uart_boards: must be within [1, 8]"));
    expect_refused(replaced(good, "[4, 4]", "[6.5, 1.5]"), HasSubstr("8 together"));
    expect_refused(replaced(good, "[4, 4]", "[]"), HasSubstr("8 together"));
    expect_refused(replaced(good, "uart_boards =", "#"), HasSubstr("uart_boards: must be given"));
    expect_refused(replaced(good, "\"uart\"", "\"sh4\""), HasSubstr("unknown key"));
}

TEST(VariantFile, WhatTheMotorsBearMayBeSaidForAllOrForOne) {
    EXPECT_EQ(spidar_g6_x3r().strings[4].continuous_tension, 0.0) << "not known";
    const std::string text =
        replaced(x3r_text(), "[axes]", "continuous_tension = 4.0\nthermal_time_constant_s = 30.0\n[axes]");
    const Variant variant =
        parse_variant(replaced(text, "[[string]]  # 7: upper near\n", "[[string]]\ncontinuous_tension = 2.5\n"), "x");
    EXPECT_EQ(variant.strings[6].continuous_tension, 4.0);
    EXPECT_EQ(variant.strings[7].continuous_tension, 2.5);
    EXPECT_EQ(variant.strings[7].thermal_time_constant_s, 30.0);
    EXPECT_EQ(parse_variant(to_toml(variant, ""), "copy"), variant);
    expect_refused(replaced(text, "= 4.0", "= -4.0"), HasSubstr("continuous_tension: must be within [0, 200]"));
}

TEST(VariantFile, FindsBuiltInNamesAndPaths) {
    EXPECT_EQ(find_variant("SpidarG6X4").name, "SpidarG6X4");
    EXPECT_EQ(find_variant((kFolder / "x4.toml").string()), builtin_variant("SpidarG6X4"));
    EXPECT_THAT([] { (void)find_variant("X4"); },
                ThrowsMessage<std::invalid_argument>(AllOf(HasSubstr("'X4'"), HasSubstr("SpidarG6X4"))));
    EXPECT_THAT([] { (void)find_variant("nowhere.toml"); }, ThrowsMessage<ConfigError>(HasSubstr("nowhere.toml")));
}

TEST(VariantFile, WarnsOfFramesThatAreNotWrenchClosedByName) {
    for (const std::string& name : builtin_variant_names()) {
        const std::vector<VariantWarning> warnings = warnings_of(builtin_variant(name));
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
