#include "haptic/device/device_geometry_writer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>

#include "haptic/device/device_geometry_file.hpp"

namespace haptic::device {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

class DeviceGeometryWriter : public testing::Test {
  protected:
    void SetUp() override { std::filesystem::create_directory(folder); }
    void TearDown() override { std::filesystem::remove_all(folder); }

    static std::string content_of(const std::filesystem::path& path) {
        std::ifstream stream(path);
        return {std::istreambuf_iterator<char>(stream), {}};
    }
    [[nodiscard]] std::ptrdiff_t files() const {
        return std::distance(std::filesystem::directory_iterator(folder), std::filesystem::directory_iterator());
    }

    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("haptic-geometry-" + std::to_string(getpid()));
    std::filesystem::path file = folder / "mine.toml";
};

TEST_F(DeviceGeometryWriter, WritesWhatIsReadBackToTheSameBits) {
    DeviceGeometry geometry = built_in_geometry("SpidarG6X4");
    geometry.strings[3].motor.x += 1.0 / 3e4;
    geometry.strings[5].metres_per_count *= 1.00123456789;
    EXPECT_FALSE(write_device_geometry(file, geometry, "of my own").has_value());
    EXPECT_EQ(load_device_geometry(file), geometry);
    EXPECT_THAT(content_of(file), StartsWith("# of my own\n"));
    EXPECT_EQ(files(), 1);
}

TEST_F(DeviceGeometryWriter, KeepsEveryFileThatItReplaces) {
    std::ofstream(file) << "first";
    const DeviceGeometry geometry = built_in_geometry("SpidarG6X3R");
    EXPECT_EQ(write_device_geometry(file, geometry, "second"), folder / "mine.toml.bak-1");
    EXPECT_EQ(write_device_geometry(file, geometry, "third"), folder / "mine.toml.bak-2");
    EXPECT_EQ(content_of(folder / "mine.toml.bak-1"), "first");
    EXPECT_THAT(content_of(folder / "mine.toml.bak-2"), StartsWith("# second"));
    EXPECT_THAT(content_of(file), StartsWith("# third"));
    EXPECT_EQ(files(), 3);
}

TEST_F(DeviceGeometryWriter, LeavesTheOldFileWhereTheNewOneCannotBeRead) {
    std::ofstream(file) << "old";
    DeviceGeometry broken = built_in_geometry("SpidarG6X3R");
    broken.strings[2].motor.y = 50.0;  // m
    EXPECT_THROW(static_cast<void>(write_device_geometry(file, broken, "")), std::runtime_error);
    EXPECT_EQ(content_of(file), "old");
    EXPECT_EQ(files(), 1) << "nothing is left beside it";
}

TEST_F(DeviceGeometryWriter, NamesTheFileThatCannotBeWritten) {
    const DeviceGeometry geometry = built_in_geometry("SpidarG6X3R");
    try {
        write_device_geometry("/nonexistent/mine.toml", geometry, "");
        FAIL();
    } catch (const std::runtime_error& error) {
        EXPECT_THAT(error.what(), HasSubstr("/nonexistent/mine.toml: cannot be written: No such file"));
    }
    EXPECT_THROW(static_cast<void>(write_device_geometry("/dev/null", geometry, "")), std::runtime_error);
}

}  // namespace
}  // namespace haptic::device
