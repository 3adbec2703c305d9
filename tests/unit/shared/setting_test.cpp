#include "haptic/setting.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/setting_documents.hpp"
#include "temporary_file.hpp"

namespace haptic {
namespace {

using test::message_of;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

enum class Method : std::uint8_t { Fast, Exact };

struct Inner {
    double mass = 0.25;
};

struct ExampleSettings {
    double step = 0.01;
    int passes = 5;
    std::int64_t limit_ns = 2'000'000;
    bool on = true;
    std::string name = "a \"b\"";
    std::string line;
    NumberOrWord stiffness{std::nullopt, "auto"};
    Method method = Method::Exact;
    Vec3 gravity{0.0, -9.81, 0.0};
    Quat rotation{1.0, 0.0, 0.0, 0.0};
    std::vector<double> times{0.0, 1.0};
    std::optional<double> share;
    Inner inner;
};

const SettingTable<ExampleSettings>& table() {
    using S = ExampleSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> settings{
        "solver",
        "An example.",
        {
            {{.key = "step", .unit = "s", .label = "Rate", .meaning = "Length of a step."},
             V::number(&S::step, {1e-4, 0.1})},
            {{.key = "passes", .old_key = "solver.loops", .meaning = "Passes."}, V::integer(&S::passes, {0, 1000})},
            {{.key = "limit_s", .unit = "s", .meaning = "Limit."}, V::duration(&S::limit_ns, {1e-6, 1.0})},
            {{.key = "on", .meaning = "Switch."}, V::flag(&S::on)},
            {{.key = "name", .meaning = "Name."}, V::text(&S::name)},
            {{.key = "line", .meaning = "Line."},
             V::parsed(&S::line, {"text or integer", Range{0, 31}}, "\"\"",
                       [](const Config& c, const std::string& key) {
                           return c.has_text(key) ? c.text(key, "") : std::to_string(c.integer(key, 0, {0, 31}));
                       })},
            {{.key = "stiffness", .unit = "N/m", .meaning = "Stiffness."},
             V::number_or_word(&S::stiffness, {1.0, 1e6}, {"auto", "none"})},
            {{.key = "method", .old_key = "old.way", .meaning = "Method."},
             V::choice(&S::method, {{"fast", Method::Fast}, {"exact", Method::Exact}})},
            {{.key = "gravity", .unit = "m/s^2", .meaning = "Gravity."}, V::vector(&S::gravity, {-1e3, 1e3})},
            {{.key = "rotation", .meaning = "Rotation."}, V::rotation(&S::rotation)},
            {{.key = "times", .unit = "s", .meaning = "Times."}, V::numbers(&S::times, {0.0, 1e6})},
            {{.key = "share", .meaning = "Share."}, V::optional_number(&S::share, {0.0, 1.0})},
            {{.key = "mass", .unit = "kg", .default_note = "that of the body", .meaning = "Mass."},
             V::number([](S& s) -> auto& { return s.inner.mass; }, {0.0, 1.0})},
        }};
    return settings;
}

ExampleSettings read(const std::string& toml) {
    const Config config = Config::parse(toml, "a.toml");
    ExampleSettings example;
    table().read(config, example);
    config.reject_unknown();
    return example;
}

std::string error_of(const std::string& toml) {
    return message_of<ConfigError>([&] { (void)read(toml); });
}

TEST(SettingTable, ReadsEachKindOfValueIntoItsMember) {
    const ExampleSettings all = read(R"([solver]
step = 0.002
passes = 9
limit_s = 0.5
on = false
name = "x"
line = 5
stiffness = 250
method = "fast"
gravity = [1, 2, 3]
rotation = [0.5, 0.5, 0.5, 0.5]
times = [4.0]
share = 0.75
mass = 0.5
)");
    EXPECT_EQ(all.step, 0.002);
    EXPECT_EQ(all.passes, 9);
    EXPECT_EQ(all.limit_ns, 500'000'000);
    EXPECT_FALSE(all.on);
    EXPECT_EQ(all.name, "x");
    EXPECT_EQ(all.line, "5");
    EXPECT_EQ(all.stiffness.number, 250.0);
    EXPECT_EQ(all.method, Method::Fast);
    EXPECT_EQ(all.gravity, Vec3(1.0, 2.0, 3.0));
    EXPECT_EQ(all.rotation, Quat(0.5, 0.5, 0.5, 0.5));
    EXPECT_THAT(all.times, ElementsAre(4.0));
    EXPECT_EQ(all.share, 0.75);
    EXPECT_EQ(all.inner.mass, 0.5);
}

TEST(SettingTable, KeepsTheMembersOfKeysThatAreMissing) {
    const ExampleSettings none = read("");
    EXPECT_EQ(none.step, 0.01);
    EXPECT_EQ(none.limit_ns, 2'000'000);
    EXPECT_EQ(none.method, Method::Exact);
    EXPECT_EQ(none.stiffness.word, "auto");
    EXPECT_EQ(none.share, std::nullopt);
}

TEST(SettingTable, RefusesWrongValuesAndUnknownKeysWithTheirLines) {
    EXPECT_EQ(error_of("[solver]\nstep = 1.0\n"), "a.toml:2: solver.step: must be within [1e-04, 0.1], is 1");
    EXPECT_EQ(error_of("[solver]\nmethod = \"slow\"\n"),
              "a.toml:2: solver.method: must be one of \"fast\", \"exact\", is \"slow\"");
    EXPECT_EQ(error_of("[solver]\nstiffness = \"much\"\n"),
              "a.toml:2: solver.stiffness: must be one of \"auto\", \"none\", is \"much\"");
    EXPECT_EQ(error_of("[solver]\nline = 99\n"), "a.toml:2: solver.line: must be within [0, 31], is 99");
    EXPECT_EQ(error_of("[solver]\n\nsteps = 1\n"),
              "a.toml:3: solver.steps: unknown key; did you mean \"solver.step\"?");
}

TEST(SettingTable, ReadsTheSameKeysFromAnotherTable) {
    const Config config = Config::parse("[[objects]]\n[[objects]]\nstep = 0.05\n", "a.toml");
    ExampleSettings example;
    table().read(config, "objects.1", example);
    EXPECT_EQ(example.step, 0.05);
}

TEST(SettingTable, AcceptsAFormerNameWithANoticeThatNamesItsLine) {
    testing::internal::CaptureStderr();
    EXPECT_EQ(read("[solver]\n\nloops = 7\n").passes, 7);
    EXPECT_EQ(read("[old]\nway = \"fast\"\n").method, Method::Fast);
    EXPECT_EQ(testing::internal::GetCapturedStderr(),
              "a.toml:3: solver.loops: is the former name of solver.passes; please rename it\n"
              "a.toml:2: old.way: is the former name of solver.method; please rename it\n");
    testing::internal::CaptureStderr();
    EXPECT_EQ(error_of("[solver]\n\nloops = 7000\n"), "a.toml:3: solver.passes: must be within [0, 1000], is 7000");
    EXPECT_EQ(error_of("[solver]\nloops = 7\npasses = 8\n"),
              "a.toml:2: solver.loops: is the former name of solver.passes, which is given too; keep one of them");
    (void)testing::internal::GetCapturedStderr();
}

TEST(SettingTable, LetsTheCommandLineOverrideTheFileWhicheverNameEachUses) {
    const auto read_with = [](const std::string& toml, const std::vector<std::string>& assignments) {
        Config config = Config::parse(toml, "a.toml");
        for (const std::string& assignment : assignments) {
            config.set(assignment);
        }
        ExampleSettings example;
        table().read(config, example);
        config.reject_unknown();
        EXPECT_THAT(config.toml(), Not(HasSubstr("loops"))) << "written with the new name";
        return example.passes;
    };
    testing::internal::CaptureStderr();
    EXPECT_EQ(read_with("[solver]\nloops = 7\n", {"solver.passes=8"}), 8);
    EXPECT_EQ(read_with("[solver]\npasses = 7\n", {"solver.loops=8"}), 8);
    EXPECT_EQ(read_with("", {"solver.loops=8"}), 8);
    EXPECT_EQ(read_with("", {"solver.loops=8", "solver.passes=9"}), 9) << "the later one";
    EXPECT_EQ(read_with("", {"solver.passes=9", "solver.loops=8"}), 8) << "the later one";
    (void)testing::internal::GetCapturedStderr();
}

TEST(SettingTable, DescribesEachKeyWithTheDefaultOfTheStruct) {
    const SettingSection section = table().describe();
    const SettingReference reference{section};
    EXPECT_EQ(find_setting(reference, "solver.step").default_value, "0.01");
    EXPECT_EQ(find_setting(reference, "solver.step").label, "Rate");
    EXPECT_EQ(find_setting(reference, "solver.limit_s").default_value, "0.002");
    EXPECT_EQ(find_setting(reference, "solver.name").default_value, R"("a \"b\"")");
    EXPECT_EQ(find_setting(reference, "solver.method").default_value, "\"exact\"");
    EXPECT_EQ(find_setting(reference, "solver.gravity").default_value, "[0.0, -9.81, 0.0]");
    EXPECT_EQ(find_setting(reference, "solver.share").default_value, "");
    EXPECT_EQ(find_setting(reference, "solver.step").type.range->max, 0.1);
    EXPECT_THROW((void)find_setting(reference, "solver.loops"), std::out_of_range);
}

TEST(SettingDocuments, WriteADefaultFileThatNamesEveryKeyAndReadsBackToTheDefaults) {
    const SettingReference reference{table().describe()};
    const std::string toml = commented_toml("Heading.", reference);
    EXPECT_THAT(toml, HasSubstr("# Heading.\n"));
    EXPECT_THAT(toml, HasSubstr("\n[solver]\n# An example.\nstep = 0.01"));
    EXPECT_THAT(toml, HasSubstr("# s, 0.0001 to 0.1. Length of a step.\n"));
    EXPECT_THAT(toml, HasSubstr("\n# share = ...")) << "a key without a default is commented out";
    const Config config = Config::parse(toml, "default.toml");
    ExampleSettings example;
    table().read(config, example);
    EXPECT_NO_THROW(config.reject_unknown());
    EXPECT_EQ(commented_toml("Heading.", {table().describe(example)}), toml);
}

TEST(SettingDocuments, WriteReferencePages) {
    const SettingReference reference{table().describe()};
    const std::string markdown = markdown_reference("# Title\n", reference);
    EXPECT_THAT(markdown, HasSubstr("| `step` | `0.01` | s | 0.0001 to 0.1 | Length of a step. Can be changed while "
                                    "the scene runs. |\n"));
    EXPECT_THAT(markdown, HasSubstr("| `passes` | `5` |  | 0 to 1000 | Passes. Former name: solver.loops. |\n"));
    EXPECT_THAT(markdown, HasSubstr("| `mass` | that of the body | kg | 0 to 1 | Mass. |\n"));
    const std::string roff = roff_reference(reference);
    EXPECT_THAT(roff, HasSubstr(".SS \"[solver]\"\nAn example.\n.TP\n.BR \"step\" \" = 0.01\"\ns, 0.0001 to 0.1."));
    EXPECT_THAT(roff, HasSubstr(".BR \"method\" \" = \"\"exact\"\"\"\n"));
    EXPECT_THAT(roff, HasSubstr("[0.0, \\-9.81, 0.0]"));
}

TEST(SettingDocuments, ListTheWordsThatCompleteAnAssignment) {
    const std::vector<std::string> words = completion_words({table().describe()});
    for (const char* word :
         {"solver.step=", "solver.on=true", "solver.method=fast", "solver.stiffness=none", "solver.stiffness="}) {
        EXPECT_THAT(words, Contains(word));
    }
    EXPECT_THAT(words, Not(Contains("solver.method=")));
}

TEST(SettingDocuments, WriteNumbersShortButExact) {
    EXPECT_EQ(toml_value(200.0), "200.0");
    EXPECT_EQ(toml_value(1e6), "1e6");
    EXPECT_EQ(toml_value(2e-5), "2e-5");
    EXPECT_EQ(toml_value(-1e-10), "-1e-10");
    EXPECT_EQ(toml_value(0.1), "0.1");
    EXPECT_EQ(roff_text(".a\\b"), "\\&.a\\eb");
}

}  // namespace
}  // namespace haptic
