// host-sim new-scene, and the scenes that it writes, as users run them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "process.hpp"

namespace haptic::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kTetrahedron = "v 0 0 0\nv 3 0 0\nv 0 3 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

class NewScene : public testing::Test {
  protected:
    [[nodiscard]] std::string write(const std::string& name, const std::string& content) const {
        std::ofstream(folder_ / name, std::ios::binary) << content;
        return folder_ / name;
    }
    [[nodiscard]] std::string content(const std::string& name) const {
        std::ifstream file(folder_ / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    /// Runs host-sim in a folder.
    [[nodiscard]] static Finished run_in(const std::string& folder, const std::string& arguments) {
        return run({"/bin/sh", "-c", "cd '" + folder + "' && '" HOST_SIM "' " + arguments});
    }
    [[nodiscard]] Finished refuse(const std::string& mesh) const {
        Finished made = run({HOST_SIM, "new-scene", mesh, "--out", folder_ / "refused.toml"});
        EXPECT_FALSE(std::filesystem::exists(folder_ / "refused.toml"));
        return made;
    }

    ScratchFolder folder_;
};

TEST_F(NewScene, OfTheExamplesRunsAtOnceAndIsFelt) {
    for (const char* const mesh : {"04-own-mesh-as-body/ring.obj", "05-own-mesh-as-tool/pestle.obj"}) {
        const std::string scene = folder_ / "body.toml";
        const Finished made = run({HOST_SIM, "new-scene", EXAMPLES "/" + std::string(mesh), "--out", scene, "--force"});
        ASSERT_EQ(made.status, 0) << made.output;
        EXPECT_THAT(made.output, HasSubstr("watertight"));
        EXPECT_THAT(made.output, HasSubstr("host-sim run " + scene + " --verify\n"));
        EXPECT_THAT(made.output, HasSubstr("host-sim run " + scene + " --view --view-control"));
        const Finished checked = run({HOST_SIM, "check", scene});
        EXPECT_EQ(checked.status, 0) << checked.output;
        const Finished ran = run({HOST_SIM, "run", scene, "--verify", "--report", folder_ / "report.json"});
        EXPECT_EQ(ran.status, 0) << ran.output;
        const auto report = nlohmann::json::parse(content("report.json"));
        EXPECT_EQ(report.at("contact").at("escapes"), 0);
        const double peak = report.at("force_N").at("max");
        EXPECT_NEAR(peak, 1.0, 0.1);
    }
}

TEST_F(NewScene, RunsFromAnyFolder) {
    std::filesystem::create_directories(folder_ / "meshes");
    std::filesystem::create_directories(folder_ / "scenes");
    (void)write("meshes/own body.obj", kTetrahedron);
    const Finished made = run_in(folder_ / "meshes", "new-scene 'own body.obj' --out ../scenes/own.toml");
    ASSERT_EQ(made.status, 0) << made.output;
    EXPECT_THAT(content("scenes/own.toml"), HasSubstr("file = \"../meshes/own body.obj\""));
    EXPECT_EQ(run_in("/", "check '" + (folder_ / "scenes/own.toml").string() + "'").status, 0);
    EXPECT_EQ(run_in(folder_ / "scenes", "check own.toml").status, 0);
    EXPECT_EQ(run_in(folder_ / "meshes", "check ../scenes/own.toml").status, 0);
}

TEST_F(NewScene, WritesNoFileOverAnother) {
    (void)write("own.obj", kTetrahedron);
    (void)write("own.toml", "# mine\n");
    const Finished refused = run_in(folder_ / "", "new-scene own.obj");
    EXPECT_EQ(refused.status, 1);
    EXPECT_THAT(refused.output, HasSubstr("own.toml: exists; --force overwrites it"));
    EXPECT_EQ(content("own.toml"), "# mine\n");
    EXPECT_EQ(run_in(folder_ / "", "new-scene own.obj --force").status, 0);
    EXPECT_THAT(content("own.toml"), HasSubstr("file = \"own.obj\""));
}

TEST_F(NewScene, SaysWhatIsWrongWithAMesh) {
    const Finished missing = refuse(folder_ / "none.obj");
    EXPECT_EQ(missing.status, 1);
    EXPECT_THAT(missing.output, HasSubstr("none.obj: No such file or directory"));
    const Finished unknown = refuse(write("a.txt", kTetrahedron));
    EXPECT_EQ(unknown.status, 1);
    EXPECT_THAT(unknown.output, HasSubstr("known extensions are .obj"));
    const Finished empty = refuse(write("empty.obj", ""));
    EXPECT_EQ(empty.status, 1);
    EXPECT_THAT(empty.output, HasSubstr("is empty"));
    const Finished points = refuse(write("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"));
    EXPECT_EQ(points.status, 1);
    EXPECT_THAT(points.output, HasSubstr("points.obj: "));
    const Finished infinite = refuse(write("nan.obj", "v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n"));
    EXPECT_EQ(infinite.status, 1);
    EXPECT_THAT(infinite.output, HasSubstr("nan.obj: "));
    EXPECT_EQ(run({HOST_SIM, "new-scene"}).status, 64);
    EXPECT_EQ(refuse("--no-such-option").status, 64);
    EXPECT_EQ(run({HOST_SIM, "new-scene", write("b.obj", kTetrahedron), "--out", folder_ / "no/folder.toml"}).status,
              64);
}

}  // namespace
}  // namespace haptic::test
