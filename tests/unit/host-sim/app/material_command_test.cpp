// host-sim material and host-sim materials: tables, files and refusals.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "app/commands.hpp"
#include "app/material_tables.hpp"
#include "haptic/sim/material.hpp"
#include "program/exit_status.hpp"
#include "program/run_program.hpp"

namespace haptic::sim {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct Ran {
    int status = 0;
    std::string output;
    std::string errors;
};

class MaterialCommand : public ::testing::Test {
  protected:
    MaterialCommand() { std::filesystem::create_directories(folder_); }
    ~MaterialCommand() override { std::filesystem::remove_all(folder_); }

    static Ran run(std::vector<const char*> arguments) {
        CLI::App app("host-sim", "host-sim");
        CLI::App& material = *app.add_subcommand("material", "");
        const Command test = add_material_command(material);
        const Command list = add_materials_command(*app.add_subcommand("materials", ""));
        arguments.insert(arguments.begin(), "host-sim");
        ::testing::internal::CaptureStdout();
        ::testing::internal::CaptureStderr();
        Ran ran;
        ran.status = run_program(app, static_cast<int>(arguments.size()), arguments.data(),
                                 [&] { return material.parsed() ? test() : list(); });
        ran.output = ::testing::internal::GetCapturedStdout();
        ran.errors = ::testing::internal::GetCapturedStderr();
        return ran;
    }
    [[nodiscard]] std::string content(const std::string& name) const {
        std::ifstream file(folder_ / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    [[nodiscard]] std::string write_scene(const std::string& model) const {
        const std::filesystem::path file = folder_ / "scene.toml";
        std::ofstream(file) << "[model]\n" << model;
        return file.string();
    }

    std::filesystem::path folder_ =
        std::filesystem::path(::testing::TempDir()) / ("haptic-material-test-" + std::to_string(getpid()));
};

TEST_F(MaterialCommand, ListsEachNamedMaterialWithItsSource) {
    const Ran ran = run({"materials"});
    EXPECT_EQ(ran.status, kExitDone);
    for (const NamedMaterial& material : named_materials()) {
        EXPECT_THAT(ran.output, HasSubstr("\n" + std::string(material.name) + " "));
        EXPECT_THAT(ran.output, HasSubstr(std::string(material.source) + "\n"));
    }
    EXPECT_THAT(ran.output, HasSubstr("120 kPa"));
    EXPECT_THAT(ran.output, HasSubstr("1.1 uN m"));
}

TEST_F(MaterialCommand, TestsBarsOfASolid) {
    const std::string out = folder_ / "out";
    const Ran ran =
        run({"material", "liver", "--particles", "80", "--press-particles", "150,200", "--out", out.c_str()});
    EXPECT_EQ(ran.status, kExitDone) << ran.errors;
    EXPECT_THAT(ran.output,
                AllOf(HasSubstr("80 particles"), HasSubstr("5.5 kPa"), HasSubstr("shear modulus in torsion"),
                      HasSubstr("step of 20 ms"), Not(HasSubstr("still moving"))));
    const std::string bars = content("out/bars.csv");
    EXPECT_THAT(bars, HasSubstr("specimen,number,quantity,unit,requested,measured,ratio,substeps,time_s,at_rest\n"
                                "80 particles,80,Young's modulus in tension,Pa,5500,"));
    EXPECT_EQ(std::count(bars.begin(), bars.end(), '\n'), 5);
    const std::string steps = content("out/steps.csv");
    EXPECT_EQ(std::count(steps.begin(), steps.end(), '\n'), 6);
    // Gnuplot skips the heading because columns have names; `every ::1` would skip the first line of numbers too.
    EXPECT_THAT(content("out/bars.gp"), AllOf(HasSubstr("'bars.csv' using 'number'"), Not(HasSubstr("every ::"))));
    EXPECT_THAT(ran.output,
                AllOf(HasSubstr("sphere of radius 200 mm pressed into a layer of liver, 150 mm wide, 50 mm thick:"),
                      HasSubstr("Dimitriadis"), HasSubstr("Young's modulus pressed")));
    const std::string press = content("out/press.csv");
    EXPECT_THAT(press, HasSubstr("particles,depth_m,half_space_n,series_n,requested_n,measured_n,ratio,substeps,at_rest"
                                 "\n150,0.001,"));
    EXPECT_EQ(std::count(press.begin(), press.end(), '\n'), 9);
    EXPECT_THAT(content("out/press.gp"), HasSubstr("column('particles') == 200 ? column('measured_n')"));
    EXPECT_THAT(content("out/press-moduli.csv"), HasSubstr("\n200 particles,200,Young's modulus pressed,Pa,5500,"));
}

TEST_F(MaterialCommand, TestsASheetAndDrapesADisc) {
    const std::string out = folder_ / "out";
    const Ran ran = run({"material", "latex", "--out", out.c_str()});
    EXPECT_EQ(ran.status, kExitDone) << ran.errors;
    EXPECT_THAT(ran.output, AllOf(HasSubstr("membrane stiffness"), HasSubstr("260 N/m"), HasSubstr("bending stiffness"),
                                  HasSubstr("1.1 uN m"), HasSubstr("coefficient"), HasSubstr("folds")));
    EXPECT_THAT(content("out/drape.obj"), HasSubstr("\nf "));
}

TEST_F(MaterialCommand, TestsTheBodyOfAScene) {
    const std::string scene =
        write_scene("generator = \"block\"\nneighbours = 16\nmaterial = { young_modulus = 1e4 }\n");
    const Ran ran = run({"material", scene.c_str(), "--set", "model.particles_count=100", "--particles", "60",
                         "--press-particles", "100"});
    EXPECT_EQ(ran.status, kExitDone) << ran.errors;
    EXPECT_THAT(ran.output, AllOf(HasSubstr("body \"block\", 100 particles, by homogeneous stress:"),
                                  HasSubstr("bulk modulus"), HasSubstr("10 kPa")));
}

TEST_F(MaterialCommand, TestsABodyWithoutAScene) {
    const Ran ran = run({"material", "block", "--set", "model.material=liver", "--set", "model.particles_count=100",
                         "--particles", "60", "--press-particles", "100"});
    EXPECT_EQ(ran.status, kExitDone) << ran.errors;
    EXPECT_THAT(ran.output, HasSubstr("body \"block\", 100 particles, by homogeneous stress:"));
    const Ran missing = run({"material", "missing.obj", "--set", "model.material=liver"});
    EXPECT_EQ(missing.status, kExitFailed);
    EXPECT_THAT(missing.errors, HasSubstr("host-sim: model.file: \"missing.obj\" cannot be read"));
}

TEST_F(MaterialCommand, TestsTheSheetOfASceneWithItsOwnCells) {
    const std::string scene =
        write_scene("generator = \"cloth\"\nvertices_per_side = 11\nside = 0.5\nmaterial = \"cotton\"\n");
    const Ran ran = run({"material", scene.c_str()});
    EXPECT_EQ(ran.status, kExitDone) << ran.errors;
    EXPECT_THAT(ran.output, AllOf(HasSubstr("sheet of cotton, 11 x 11 vertices:"), HasSubstr("square of 0.5 m"),
                                  HasSubstr("strip of 0.1 m")));
}

TEST_F(MaterialCommand, RequestsNothingOfABodyOfSeveralMaterials) {
    const std::string scene = write_scene(
        "generator = \"block\"\nneighbours = 16\nparticles_count = 100\nmaterial = \"liver\"\n"
        "[[model.regions]]\nlow = [0, -1, -1]\nhigh = [1, 1, 1]\nmaterial = \"muscle\"\n");
    const Ran ran = run({"material", scene.c_str(), "--particles", "60", "--press-particles", "100"});
    EXPECT_EQ(ran.status, kExitDone) << ran.errors;
    EXPECT_THAT(ran.output, HasSubstr("regions have other materials"));
    EXPECT_THAT(ran.output, ::testing::ContainsRegex("Young's modulus stretched +- +[0-9.]+ kPa +- "));
}

TEST_F(MaterialCommand, RefusesWhatItCannotTest) {
    const Ran unknown = run({"material", "unobtainium"});
    EXPECT_EQ(unknown.status, kExitFailed);
    EXPECT_THAT(unknown.errors, AllOf(HasSubstr("\"unobtainium\""), HasSubstr("host-sim materials")));
    EXPECT_THAT(run({"material", "livr"}).errors, HasSubstr("did you mean liver?"));
    EXPECT_THAT(run({"material", "fsh"}).errors, HasSubstr("did you mean fish?"));
    const std::string scene = write_scene("generator = \"plate\"\n");
    const Ran rigid = run({"material", scene.c_str()});
    EXPECT_EQ(rigid.status, kExitFailed);
    EXPECT_THAT(rigid.errors, HasSubstr("no body has a material"));
    EXPECT_THAT(run({"material", "latex", "--out", "/proc/none"}).errors,
                ::testing::StartsWith("host-sim: --out: /proc/none: "));
    EXPECT_EQ(run({"material"}).status, kExitUsage);
    EXPECT_EQ(run({"material", "liver", "--particles", "3"}).status, kExitUsage);
    EXPECT_EQ(run({"material", "liver", "--press-particles", "3"}).status, kExitUsage);
    EXPECT_EQ(run({"material", "liver", "--set", "model.mass=1"}).status, kExitUsage);
}

TEST(MaterialTables, ValuesHaveThePrefixThatFits) {
    EXPECT_EQ(with_unit(3e4, "Pa"), "30 kPa");
    EXPECT_EQ(with_unit(1.5e6, "Pa"), "1.5 MPa");
    EXPECT_EQ(with_unit(5e-7, "N m"), "0.5 uN m");
    EXPECT_EQ(with_unit(0.4496, ""), "0.4496");
    EXPECT_EQ(with_unit(0.0, "N m"), "0 uN m");
}

TEST(MaterialTables, ValuesThatWereNotRequestedHaveNoRatio) {
    const TestTable table{
        .name = "t",
        .title = "t:",
        .lines = {{.specimen = "body", .quantity = "q", .unit = "Pa", .requested = {}, .measured = 2.0},
                  {.specimen = "body", .quantity = "r", .unit = "", .requested = 0.0, .measured = 0.5}}};
    EXPECT_THAT(csv_of(table), AllOf(HasSubstr("body,0,q,Pa,-,2,-,0,0,1\n"), HasSubstr("body,0,r,,0,0.5,-,0,0,1\n")));
}

TEST(MaterialTables, ValuesOfWhatWasStillMovingHaveNoRatio) {
    const TestTable table{
        .name = "t",
        .title = "t:",
        .lines = {
            {.specimen = "body", .quantity = "q", .unit = "Pa", .requested = 4.0, .measured = 2.0, .at_rest = false},
            {.specimen = "body", .quantity = "r", .unit = "Pa", .requested = 4.0, .measured = 2.0}}};
    EXPECT_THAT(csv_of(table), AllOf(HasSubstr("body,0,q,Pa,4,2,-,0,0,0\n"), HasSubstr("body,0,r,Pa,4,2,0.5,0,0,1\n")));
    std::ostringstream printed;
    print(printed, table);
    EXPECT_THAT(printed.str(), AllOf(HasSubstr("2 Pa *  "), HasSubstr("unreliable")));
}

}  // namespace
}  // namespace haptic::sim
