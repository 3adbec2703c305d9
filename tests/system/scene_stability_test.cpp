// rt-core stability --scene: both programs in lockstep, as users run them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "process.hpp"

namespace haptic::test {
namespace {

class SceneStability : public testing::Test {
  protected:
    /// The hand presses the curtain, or the scene in `more`, and is held still: one stiffness and step rate.
    [[nodiscard]] Finished map(const std::string& name, const std::string& rate, const std::string& stiffness,
                               const std::string& delay,
                               const std::vector<std::string>& more = {"--scene", "curtain-hand", "--hold",
                                                                       "1.8"}) const {
        std::vector<std::string> command{RT_CORE,         "stability",  "--host-sim", HOST_SIM,  "--out",
                                         folder_ / name,  "--duration", "3",          "--rates", rate,
                                         "--stiffnesses", stiffness,    "--delays",   delay};
        command.insert(command.end(), more.begin(), more.end());
        return run(command);
    }
    [[nodiscard]] std::string csv(const std::string& name) const {
        std::ostringstream text;
        text << std::ifstream(folder_ / name / "stability-curtain-hand.csv").rdbuf();
        return text.str();
    }

    ScratchFolder folder_;
};

TEST_F(SceneStability, DependsOnTheSettingsOnly) {
    const Finished first = map("first", "100", "200", "20");
    ASSERT_EQ(first.status, 0) << first.output;
    const Finished second = map("second", "100", "200", "20");
    ASSERT_EQ(second.status, 0) << second.output;
    EXPECT_EQ(csv("first"), csv("second"));
    // The scene is felt: without contact all trials would be stable.
    const CsvTable table = CsvTable::load(folder_ / "first" / "stability-curtain-hand.csv");
    ASSERT_EQ(table.rows(), 1U);
    EXPECT_GT(table.column("touching_share")[0], 0.5);
    EXPECT_GT(table.column("peak_force_n")[0], 0.3);
}

TEST_F(SceneStability, LeavesNoSharedMemoryBehind) {
    const Finished finished = map("left", "100", "200", "20");
    ASSERT_EQ(finished.status, 0) << finished.output;
    for (const char* const trial : {"-0", "-1"}) {
        EXPECT_THAT(segments_of("stability-" + std::to_string(finished.pid) + trial), testing::IsEmpty());
    }
}

TEST_F(SceneStability, FindsAnOscillationThatNothingControls) {
    // The finger that lifts a liver.
    const Finished late =
        map("late", "30", "600", "30",
            {"--scene", "organ-lift", "--hold", "3", "--set", "passivity.control=observe", "--hand-damping", "1"});
    EXPECT_EQ(late.status, 3) << late.output;
    EXPECT_NE(late.output.find("1 of 1 trials grow"), std::string::npos) << late.output;
}

TEST_F(SceneStability, NamesAProgramThatDoesNotStart) {
    const Finished missing = run({RT_CORE, "stability", "--scene", "curtain-hand", "--host-sim", "/no/such/host-sim",
                                  "--out", folder_ / "missing"});
    EXPECT_NE(missing.status, 0);
    EXPECT_NE(missing.output.find("/no/such/host-sim"), std::string::npos) << missing.output;
}

}  // namespace
}  // namespace haptic::test
