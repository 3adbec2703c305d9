#include "reproduce/camera.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

namespace haptic::sim {
namespace {

/// A square of side 2 at a height.
class Sheet {
  public:
    explicit Sheet(double height)
        : corners_{{{-1.0, height, -1.0}, {1.0, height, -1.0}, {1.0, height, 1.0}, {-1.0, height, 1.0}}} {}
    [[nodiscard]] PictureObject object() const { return {.vertices = corners_, .triangles = {{0, 1, 2}, {0, 2, 3}}}; }

  private:
    std::array<Vec3, 4> corners_;
};

constexpr std::array kPoints{Vec3(0.0, 0.05, 0.0), Vec3(0.0, -0.05, 0.0)};

PictureScene picture_of(const Sheet& sheet, double floor) {
    PictureScene picture;
    picture.objects.push_back(sheet.object());
    picture.floor = floor;
    return picture;
}

TEST(PictureCamera, SeesWhatIsOnItsSideOfASheet) {
    const Sheet sheet(0.0);
    const PictureScene picture = picture_of(sheet, -5.0);
    const auto share = [&](const Vec3& direction) {
        return visible_share(picture, camera_for(picture, direction), kPoints);
    };
    EXPECT_EQ(share({0.0, 1.0, 0.1}), 0.5);
    EXPECT_EQ(share({0.0, -1.0, 0.1}), 0.5);
    // The skin of the tool does not count: it is the subject.
    PictureScene tool = picture;
    tool.objects.front().tool = true;
    EXPECT_EQ(visible_share(tool, camera_for(tool, {0.0, 1.0, 0.1}), kPoints), 1.0);
}

TEST(PictureCamera, LooksFromBelowAtWhatASheetCoversAndFromAboveAtWhatLiesOnIt) {
    const Sheet over(0.2);
    const PictureScene covered = picture_of(over, -5.0);
    const Subject under{&covered, kPoints};
    EXPECT_LT(clearest_direction({&under, 1}).y, 0.0);
    const Sheet below(-0.2);
    const PictureScene open = picture_of(below, -5.0);
    const Subject on_top{&open, kPoints};
    EXPECT_GT(clearest_direction({&on_top, 1}).y, 0.0);
}

TEST(PictureCamera, StaysAboveTheGround) {
    const Sheet over(0.2);
    const PictureScene picture = picture_of(over, 0.1);
    const Subject subject{&picture, kPoints};
    const Camera camera = camera_for(picture, clearest_direction({&subject, 1}));
    EXPECT_GT(camera.position.y, 0.1);
}

}  // namespace
}  // namespace haptic::sim
