#include "haptic/workspace_region.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <string>

#include "ring_session.hpp"

namespace haptic {
namespace {

class WorkspaceRegionTest : public testing::Test {
  protected:
    test::RingSession session_;
};

TEST_F(WorkspaceRegionTest, IsReadWhileItIsPublished) {
    EXPECT_FALSE(read_region(session_.name()));
    {
        const PublishedRegion published(session_.name(), {.semi_axes = Vec3(0.0125, 0.02, 0.0133), .angle = 0.25});
        const auto region = read_region(session_.name());
        ASSERT_TRUE(region);
        EXPECT_EQ(region->semi_axes, Vec3(0.0125, 0.02, 0.0133));
        EXPECT_EQ(region->angle, 0.25);
        struct stat status{};
        ASSERT_EQ(lstat(region_path(session_.name()).c_str(), &status), 0);
        EXPECT_EQ(status.st_mode & 07777U, 0600U);
    }
    EXPECT_FALSE(read_region(session_.name()));
}

TEST_F(WorkspaceRegionTest, ReplacesWhatAKilledProcessLeft) {
    std::ofstream(region_path(session_.name())) << "left over";
    const PublishedRegion published(session_.name(), {.semi_axes = Vec3(0.01), .angle = 0.2});
    EXPECT_TRUE(read_region(session_.name()));
}

TEST_F(WorkspaceRegionTest, OfNonsenseIsNone) {
    for (const char* text : {"", "x", "0.01 0.01 0.01", "0.01 0.01 0.01 0", "nan 0.01 0.01 0.2", "0.01 -1 0.01 0.2",
                             "0.01 0.01 1e9 0.2", "0.01 0.01 0.01 9"}) {
        std::ofstream(region_path(session_.name())) << text;
        EXPECT_FALSE(read_region(session_.name())) << text;
    }
    std::filesystem::remove(region_path(session_.name()));
}

}  // namespace
}  // namespace haptic
