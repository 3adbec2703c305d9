#include "haptic/config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "temporary_file.hpp"

namespace haptic {
namespace {

using test::message_of;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

constexpr Range kAny{-1e9, 1e9};

constexpr const char* kScene = R"(# a comment
name = "cloth"
verify = true

[solver]
iterations = 5
dt = 0.01
gravity = [0.0, -9.81, 0]
weights = [1, 2.5]

[grip]
orientation = [0.5, 0.5, 0.5, 0.5]
)";

std::string error_of(std::string_view toml, const std::function<void(Config&)>& use) {
    return message_of<ConfigError>([&] {
        Config config = Config::parse(toml, "scene.toml");
        use(config);
    });
}

TEST(Config, ReadsEachType) {
    const Config config = Config::parse(kScene, "scene.toml");
    EXPECT_EQ(config.text("name", ""), "cloth");
    EXPECT_TRUE(config.flag("verify", false));
    EXPECT_EQ(config.integer("solver.iterations", 0, kAny), 5);
    EXPECT_EQ(config.number("solver.iterations", 0.0, kAny), 5.0);
    EXPECT_EQ(config.number("solver.dt", 0.0, kAny), 0.01);
    EXPECT_EQ(config.vec3("solver.gravity", {}, kAny), Vec3(0.0, -9.81, 0.0));
    EXPECT_EQ(config.numbers("solver.weights", {}, kAny), (std::vector<double>{1.0, 2.5}));
    EXPECT_EQ(config.quat("grip.orientation", {}), Quat(0.5, 0.5, 0.5, 0.5));
    EXPECT_EQ(config.choice("name", "", {"fish", "cloth"}), "cloth");
    EXPECT_NO_THROW(config.reject_unknown());
}

TEST(Config, GivesTheDefaultWhereTheFileIsSilent) {
    const Config config;
    EXPECT_EQ(config.number("a.b", 1.5, kAny), 1.5);
    EXPECT_EQ(config.integer("a.c", 7, kAny), 7);
    EXPECT_TRUE(config.flag("d", true));
    EXPECT_EQ(config.text("e", "x"), "x");
    EXPECT_EQ(config.vec3("f", {1.0, 2.0, 3.0}, kAny), Vec3(1.0, 2.0, 3.0));
    EXPECT_EQ(config.numbers("g", {4.0}, kAny), std::vector<double>{4.0});
    EXPECT_FALSE(config.has("a.b"));
    EXPECT_NO_THROW(config.reject_unknown());
}

TEST(Config, NamesFileLineKeyAndRemedyOfAnUnknownKey) {
    const auto read = [](const Config& config) {
        static_cast<void>(config.text("name", ""));
        static_cast<void>(config.flag("verify", false));
        static_cast<void>(config.integer("solver.iterations", 0, kAny));
        static_cast<void>(config.number("probes.dt", 0.0, kAny));
        static_cast<void>(config.number("solver.dt", 0.0, kAny));
        config.reject_unknown();
    };
    EXPECT_EQ(error_of("name = \"x\"\n\n[solver]\niteratoins = 5\n", read),
              "scene.toml:4: solver.iteratoins: unknown key; did you mean \"solver.iterations\"?");
    EXPECT_EQ(error_of("iterations = 5\n", read),
              "scene.toml:1: iterations: unknown key; did you mean \"solver.iterations\"?");
    EXPECT_EQ(error_of("[solver]\ncompletely_else = 5\n", read),
              "scene.toml:2: solver.completely_else: unknown key; known in [solver]: dt, iterations");
    EXPECT_EQ(error_of("[slover]\ndt = 5\n", read),
              "scene.toml:2: slover.dt: unknown key; did you mean \"solver.dt\"?");
    EXPECT_EQ(error_of("solver = 3\n", read),
              "scene.toml:1: solver: unknown key; it is a table, with keys such as \"solver.dt\"");
    EXPECT_EQ(error_of("[other]\nzz = 5\n", read), "scene.toml:2: other.zz: unknown key; known tables: probes, solver");
    EXPECT_THAT(error_of("[[object]]\na = 5\n", read), StartsWith("scene.toml:1: object: unknown key"));
    EXPECT_THAT(error_of("\n[empty]\n", read), StartsWith("scene.toml:2: empty: unknown key"));
}

TEST(Config, ReportsTheFirstUnknownKeyOfTheFile) {
    const auto read = [](const Config& config) { config.reject_unknown(); };
    EXPECT_THAT(error_of("zz = 1\naa = 2\n", read), StartsWith("scene.toml:1: zz: "));
}

TEST(Config, AcceptsAnEmptyTableOfWhichKeysAreKnown) {
    const Config config = Config::parse("[solver]\n", "scene.toml");
    static_cast<void>(config.number("solver.dt", 0.0, kAny));
    EXPECT_NO_THROW(config.reject_unknown());
}

TEST(Config, RefusesValuesOfTheWrongType) {
    const auto expect = [](const char* value, const std::function<void(Config&)>& use, const char* problem) {
        EXPECT_THAT(error_of("\n[a]\nb = " + std::string(value), use),
                    AllOf(StartsWith("scene.toml:3: a.b: "), HasSubstr(problem)))
            << value;
    };
    const auto number = [](Config& c) { static_cast<void>(c.number("a.b", 0.0, kAny)); };
    const auto integer = [](Config& c) { static_cast<void>(c.integer("a.b", 0, {0.0, 10.0})); };
    const auto vec3 = [](Config& c) { static_cast<void>(c.vec3("a.b", {}, {-1.0, 1.0})); };
    const auto quat = [](Config& c) { static_cast<void>(c.quat("a.b", {})); };
    expect("'5'", number, "must be a number, is '5'");
    expect("true", number, "must be a number");
    expect("nan", number, "must be a finite number");
    expect("-inf", number, "must be a finite number");
    expect("{c = 1}", number, "must be a number");
    expect("5.0", integer, "must be an integer");
    expect("11", integer, "must be within [0, 10], is 11");
    expect("-1", integer, "must be within [0, 10], is -1");
    expect("1", vec3, "must be a list of numbers");
    expect("[1, 0]", vec3, "must have 3 numbers, has 2");
    expect("[1, 0, 0, 0]", vec3, "must have 3 numbers, has 4");
    expect("[1, 0, 1.5]", vec3, "must be within [-1, 1], is 1.5");
    expect("[1, 0, 'x']", vec3, "must be a number");
    expect("[1, 0, 0]", quat, "must have 4 numbers");
    expect("[1, 0, 0, 0.01]", quat, "must be a unit quaternion");
    expect("[nan, 0, 0, 0]", quat, "must be a finite number");
    expect("1", [](Config& c) { static_cast<void>(c.flag("a.b", false)); }, "must be true or false, is 1");
    expect("1", [](Config& c) { static_cast<void>(c.text("a.b", "")); }, "must be a string");
    expect(
        "'dog'", [](Config& c) { static_cast<void>(c.choice("a.b", "fish", {"fish", "cloth"})); },
        "must be one of \"fish\", \"cloth\", is \"dog\"");
    expect("1", [](Config& c) { c.fail("a.b", "contradicts a.c"); }, "contradicts a.c");
}

TEST(Config, SuggestsTheNearestChoice) {
    const auto refusal = [](const std::string& value) {
        return error_of("name = \"" + value + "\"\n",
                        [](Config& c) { static_cast<void>(c.choice("name", "liver", {"liver", "muscle"})); });
    };
    EXPECT_EQ(refusal("livr"),
              "scene.toml:1: name: must be one of \"liver\", \"muscle\", is \"livr\"; did you mean \"liver\"?");
    EXPECT_EQ(refusal("steel"), "scene.toml:1: name: must be one of \"liver\", \"muscle\", is \"steel\"");
}

TEST(Config, GivesTheReasonForTheEndOfARange) {
    EXPECT_EQ(error_of("ratio = 0.5\n",
                       [](Config& c) {
                           static_cast<void>(c.number("ratio", 0.0, {0.0, 0.48, "at 0.5 nothing is compressed"}));
                       }),
              "scene.toml:1: ratio: must be within [0, 0.48], is 0.5; at 0.5 nothing is compressed");
}

TEST(Config, NormalisesQuaternionsWithinTheTolerance) {
    const Config config = Config::parse("q = [1.0000005, 0, 0, 0]", "scene.toml");
    EXPECT_EQ(config.quat("q", {}), Quat(1.0, 0.0, 0.0, 0.0));
}

TEST(Config, NamesTheLineOfMalformedToml) {
    EXPECT_THAT(error_of("a = 1\nb = = 2\n", [](Config&) {}), StartsWith("scene.toml:2: not valid TOML: "));
    EXPECT_THAT(error_of("a = 1\na = 2\n", [](Config&) {}), StartsWith("scene.toml:2: not valid TOML: "));
}

TEST(Config, NamesTheLineOfANameThatIsNone) {
    // toml++ 3.3 ends the process at these.
    for (const char* header : {"[.a]", "[[.a]]", "[ =]", "[.\n"}) {
        EXPECT_THAT(error_of("name = 1\n\n" + std::string(header) + "\nmore = 2\n", [](Config&) {}),
                    StartsWith("scene.toml:3: not valid TOML: "))
            << header;
    }
}

TEST(Config, TakesOtherThanAsciiInStringsAndCommentsOnly) {
    // 0xC2 0xB5 and 0xEF 0xBB 0x9F: for toml++ 3.3 it is undefined whether they are spaces.
    for (const char* line :
         {"\xC3\xA9 = 1", "key = \xC2\xB5", "list = [1, \xD0\x99]", "key = 1 \xFF", "s = \"a\\\"\" \xC2\xB5",
          "key = \xC2\xA0 1", "key = \xEF\xBB\x9F", "key = 3m\"a\"-\"s\xEF\xBB\xB7[", "\"\"\"\"a\\\xEF\xBB\x9F!",
          "key = \"\"\"\\\xC2\xB5\"\"\"", "[\xC2\xB5]", "a.\xC2\xB5 = 1", "a = {\xC2\xB5 = 1}"}) {
        EXPECT_THAT(error_of("name = 1\n" + std::string(line) + "\nmore = 2\n", [](Config&) {}),
                    StartsWith("scene.toml:2: not valid TOML: "))
            << line;
    }
    const Config config = Config::parse(
        "\xEF\xBB\xBF# 25 \xC2\xB5m\na = \"\xC2\xB5\\\"\xC2\xB5\"\nb = '\xC2\xB5\\' # \xC2\xB5\n"
        "c = \"\"\"\n\xC2\xB5 \"\"\xC2\xB5\"\"\"\nd = '''\xC2\xB5'''''\n\"\xC3\xA9\" = 1\n"
        "e = \"\"\"\xC2\xB5\\\\\xC2\xB5\\\n  \n\xC2\xB5\\\n\xEF\xBB\x9F\"\"\"\n",
        "x.toml");
    EXPECT_EQ(config.text("a", ""), "\xC2\xB5\"\xC2\xB5");
    EXPECT_EQ(config.text("b", ""), "\xC2\xB5\\");
    EXPECT_EQ(config.text("c", ""), "\xC2\xB5 \"\"\xC2\xB5");
    EXPECT_EQ(config.text("d", ""), "\xC2\xB5''");
    EXPECT_EQ(config.text("e", ""), "\xC2\xB5\\\xC2\xB5\xC2\xB5\xEF\xBB\x9F");
}

TEST(Config, NamesTheFileThatCannotBeRead) {
    const test::TemporaryDirectory directory;
    const auto missing = directory.file("none.toml");
    EXPECT_EQ(message_of<ConfigError>([&] { static_cast<void>(Config::load(missing)); }),
              missing.string() + ": cannot be read: No such file or directory");
    EXPECT_THAT(message_of<ConfigError>([&] { static_cast<void>(Config::load(directory.path())); }),
                EndsWith("is a directory"));
}

TEST(Config, LoadsAFileAndTakesAnEmptyOneAsNoSettings) {
    const test::TemporaryDirectory directory;
    const Config config = Config::load(directory.write("a.toml", "[a]\nb = 2\n"));
    EXPECT_EQ(config.number("a.b", 0.0, kAny), 2.0);
    EXPECT_NO_THROW(Config::load(directory.write("b.toml", "")).reject_unknown());
}

TEST(Config, FindsFilesFromItsFolderAndThoseOfSetFromTheCurrentOne) {
    const test::TemporaryDirectory directory;
    static_cast<void>(directory.write("mesh.obj", "v 0 0 0\n"));
    Config config = Config::load(directory.write("scene.toml", "file = \"mesh.obj\"\nnone = \"\"\n"));
    EXPECT_EQ(config.input_file("file", "mesh.obj"), directory.file("mesh.obj").string());
    EXPECT_EQ(config.input_file("none", ""), "");
    EXPECT_THAT(message_of<ConfigError>([&] { static_cast<void>(config.input_file("file", "no.obj")); }),
                EndsWith("scene.toml:1: file: \"no.obj\" cannot be read: No such file or directory; searched in " +
                         directory.path().string()));
    const std::filesystem::path absolute = directory.file("mesh.obj");
    EXPECT_EQ(config.input_file("file", absolute.string()), absolute.string());
    config.set("file=mesh.obj");
    EXPECT_THAT(message_of<ConfigError>([&] { static_cast<void>(config.input_file("file", "mesh.obj")); }),
                EndsWith("searched in " + std::filesystem::current_path().string()));
}

constexpr const char* kTables = R"(
[[string]]
motor = [1, 2, 3]

[[string]]
motor = [4, 5, 6]
knot = 7
)";

TEST(Config, ReadsListsOfTablesByTheirNumber) {
    const Config config = Config::parse(kTables, "frame.toml");
    EXPECT_EQ(config.tables("string"), 2u);
    EXPECT_EQ(config.vec3("string.1.motor", {}, {-10, 10}), Vec3(4, 5, 6));
    EXPECT_EQ(config.number("string.1.knot", 0.0, {-10, 10}), 7.0);
    EXPECT_TRUE(config.has("string.0.motor"));
    EXPECT_FALSE(config.has("string.0.knot"));
    EXPECT_FALSE(config.has("string.2.motor"));
    EXPECT_FALSE(config.has("string.-1.motor"));
    EXPECT_FALSE(config.has("string.x.motor"));
    EXPECT_EQ(config.tables("nothing"), 0u);
}

TEST(Config, NamesTheLineWithinAListOfTables) {
    const Config config = Config::parse(kTables, "frame.toml");
    EXPECT_EQ(config.tables("string"), 2u);
    EXPECT_EQ(message_of<ConfigError>([&] { (void)config.number("string.1.knot", 0.0, {0, 1}); }),
              "frame.toml:7: string.1.knot: must be within [0, 1], is 7");
    EXPECT_EQ(message_of<ConfigError>([&] { config.fail("string.1.nail", "must be given"); }),
              "frame.toml:5: string.1.nail: must be given")
        << "a key that is missing: the line of its table";
    (void)config.vec3("string.0.motor", {}, {-10, 10});
    (void)config.vec3("string.1.motor", {}, {-10, 10});
    config.reject_unknown();
    (void)config.number("string.0.knob", 0.0, {0, 1});
    const Config other = Config::parse(kTables, "frame.toml");
    (void)other.vec3("string.0.motor", {}, {-10, 10});
    (void)other.vec3("string.1.motor", {}, {-10, 10});
    EXPECT_THAT(message_of<ConfigError>([&] { other.reject_unknown(); }),
                StartsWith("frame.toml:7: string.1.knot: unknown key"));
}

TEST(Config, RefusesWhatIsNoListOfTables) {
    const Config config = Config::parse("string = [1, 2]\n", "frame.toml");
    EXPECT_EQ(message_of<ConfigError>([&] { (void)config.tables("string"); }),
              "frame.toml:1: string: must be tables, each headed [[string]], is [ 1, 2 ]");
}

TEST(ConfigPlace, IsThatOfTheKeyIfItIsGivenElseOfItsTable) {
    Config::Place solver;
    EXPECT_EQ(solver.where(), "");
    EXPECT_EQ(message_of<ConfigError>([&] { solver.of("dt").fail("is too long"); }), "is too long");
    {
        Config config = Config::parse(kScene, "scene.toml");
        config.set("solver.iterations=7");
        solver = config.place("solver");
    }
    EXPECT_EQ(solver.where(), "scene.toml:5: solver: ");
    EXPECT_EQ(solver.of("dt").where(), "scene.toml:7: solver.dt: ");
    EXPECT_EQ(solver.of("drag").where(), "scene.toml:5: solver: ");
    EXPECT_EQ(message_of<ConfigError>([&] { solver.of("iterations").fail("are too many"); }),
              "--set solver.iterations: are too many");
}

TEST(ConfigPlace, HasNoLineWithoutAFile) {
    EXPECT_EQ(Config::parse("[model]\nfile = \"a.obj\"\n", "").place("model").of("file").where(), "model.file: ");
}

TEST(ConfigSet, OverridesAndAddsValues) {
    Config config = Config::parse(kScene, "scene.toml");
    config.set("solver.iterations=9");
    config.set("solver.gravity = [0, 0, -1]");
    config.set("new.table.key=0x10");
    config.set("name=four-fish");
    config.set("file=/tmp/a.csv");
    config.set("quoted=\"5\"");
    config.set("verify=false");
    EXPECT_EQ(config.integer("solver.iterations", 0, kAny), 9);
    EXPECT_EQ(config.text("name", ""), "four-fish");
    EXPECT_EQ(config.text("file", ""), "/tmp/a.csv");
    EXPECT_EQ(config.text("quoted", ""), "5");
    EXPECT_EQ(config.integer("new.table.key", 0, kAny), 16);
    EXPECT_FALSE(config.flag("verify", true));
}

TEST(Config, WritesWhatItWasGivenSoThatItReadsBackTheSame) {
    Config config = Config::parse(
        "[a]\nthird = 0.3333333333333333\nname = \"x y\"\nlist = [1.0, 1e-300]\n[\"odd key\"]\n\"a\\\"b\" = -1e-300\n",
        "f.toml");
    config.set("a.count=7");
    config.set("b.c.tenth=0.1");
    config.set("b.path=/tmp/x.toml");
    config.set("many=[{x=1, deep=[{y=2}]}, {x=3}]");
    config.set("none=[]");
    const Config again = Config::parse(config.toml(), "again.toml");
    EXPECT_EQ(again.number("a.third", 0.0, {0.0, 1.0}), 0.3333333333333333);
    EXPECT_EQ(again.text("a.name", ""), "x y");
    EXPECT_EQ(again.numbers("a.list", {}, {0.0, 1.0}), (std::vector<double>{1.0, 1e-300}));
    EXPECT_EQ(again.integer("a.count", 0, {0, 10}), 7);
    EXPECT_EQ(again.number("b.c.tenth", 0.0, {0.0, 1.0}), 0.1);
    EXPECT_EQ(again.text("b.path", ""), "/tmp/x.toml");
    EXPECT_EQ(again.tables("many"), 2u);
    EXPECT_EQ(again.integer("many.0.x", 0, {0, 10}), 1);
    EXPECT_EQ(again.integer("many.0.deep.0.y", 0, {0, 10}), 2);
    EXPECT_EQ(again.integer("many.1.x", 0, {0, 10}), 3);
    EXPECT_TRUE(again.numbers("none", {1.0}, {0.0, 1.0}).empty());
    EXPECT_EQ(again.toml(), config.toml());
    EXPECT_THAT(config.toml(), HasSubstr("\n['odd key']\n'a\"b' = -1e-300\n"));
    EXPECT_NO_THROW(static_cast<void>(Config::parse(Config().toml(), "empty.toml")));
}

TEST(ConfigSet, TakesNamesThatBeginWithADigitWithoutQuotes) {
    Config config;
    for (const char* const name : {"9030000.pl061", "1-2.4", "0cec:0205"}) {
        config.set(std::string("probes.chip=") + name);
        EXPECT_EQ(config.text("probes.chip", ""), name);
    }
}

TEST(ConfigSet, RefusesWhatIsNoAssignment) {
    const auto error = [](const char* assignment) {
        return message_of<ConfigError>([&] { Config::parse(kScene, "scene.toml").set(assignment); });
    };
    EXPECT_EQ(error("solver.dt"), "--set solver.dt: must have the form key=value");
    EXPECT_THAT(error("solver.dt="), StartsWith("--set solver.dt: \"\" is not a TOML value"));
    EXPECT_THAT(error("solver.dt=1..5"), StartsWith("--set solver.dt: \"1..5\" is not a TOML value"));
    EXPECT_THAT(error("solver.dt=[1"), StartsWith("--set solver.dt: \"[1\" is not a TOML value"));
    EXPECT_THAT(error("a=1\nb=2"), StartsWith("--set a: the value must be on one line"));
    EXPECT_THAT(error("a..b=1"), StartsWith("--set a..b: is not a key"));
    EXPECT_THAT(error("=1"), StartsWith("--set : is not a key"));
    EXPECT_EQ(error("name.inner=1"), "--set name.inner: \"name\" is a value, not a table");
}

TEST(ConfigSet, ReachesTheTablesOfAListByTheirNumber) {
    Config config = Config::parse("[[objects]]\nmass = 1.0\n[[objects]]\nmass = 2.0\n", "scene.toml");
    config.set("objects.1.mass=3");
    config.set("objects.1.material.name=liver");
    EXPECT_EQ(config.number("objects.0.mass", 0.0, kAny), 1.0);
    EXPECT_EQ(config.number("objects.1.mass", 0.0, kAny), 3.0);
    EXPECT_EQ(config.text("objects.1.material.name", ""), "liver");
    EXPECT_EQ(message_of<ConfigError>([&] { config.fail("objects.1.mass", "is wrong"); }),
              "--set objects.1.mass: is wrong");
    EXPECT_EQ(message_of<ConfigError>([&] { config.set("objects.2.mass=3"); }),
              "--set objects.2.mass: there is no table 2 of [[objects]]; they count from 0");
    EXPECT_THAT(message_of<ConfigError>([&] { config.set("objects.mass=3"); }),
                AllOf(StartsWith("--set objects.mass: "), HasSubstr("as in objects.0.mass")));
}

TEST(ConfigSet, IsNamedInErrorsAboutATableThatItMade) {
    EXPECT_EQ(error_of("",
                       [](Config& config) {
                           config.set("objects.0.mass=3");
                           static_cast<void>(config.tables("objects"));
                       }),
              "--set objects.0.mass: objects: must be tables, each headed [[objects]], is a table");
}

TEST(ConfigSet, TakesOtherThanAsciiInStringsAndWords) {
    Config config;
    config.set("a=\"\xC2\xB5\"");
    config.set("b=/tmp/\xC2\xB5.csv");
    EXPECT_EQ(config.text("a", ""), "\xC2\xB5");
    EXPECT_EQ(config.text("b", ""), "/tmp/\xC2\xB5.csv");
    for (const char* value : {"\xC2\xB5", "1\xC2\xB5", "[1, \xC2\xB5]", "\"\"\"\\\xC2\xB5\"\"\""}) {
        EXPECT_THAT(message_of<ConfigError>([&] { config.set("c=" + std::string(value)); }),
                    AllOf(StartsWith("--set c: "), HasSubstr("is not a TOML value")));
    }
}

TEST(ConfigSet, IsNamedInErrorsAboutItsValue) {
    Config config = Config::parse(kScene, "scene.toml");
    config.set("solver.dt=5");
    config.set("solver.typo=5");
    config.set("grip={orientation = 1}");
    EXPECT_EQ(message_of<ConfigError>([&] { static_cast<void>(config.number("solver.dt", 0.0, {0.0, 1.0})); }),
              "--set solver.dt: must be within [0, 1], is 5");
    EXPECT_EQ(message_of<ConfigError>([&] { static_cast<void>(config.number("grip.orientation", 0.0, {2.0, 3.0})); }),
              "--set grip: grip.orientation: must be within [2, 3], is 1");
    EXPECT_THAT(message_of<ConfigError>([&] { config.reject_unknown(); }),
                StartsWith("--set solver.typo: unknown key"));
}

}  // namespace
}  // namespace haptic
