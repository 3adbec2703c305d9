#include "process/device_protocol.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "haptic/device/device_geometry_file.hpp"

namespace haptic::rt {
namespace {

using testing::HasSubstr;

class Protocol : public testing::Test {
  protected:
    void TearDown() override { std::filesystem::remove(file); }

    void write(const std::string& text) const { std::ofstream(file) << text; }
    [[nodiscard]] std::string sign(bool finished = true, const std::string& consent = "true") const {
        return std::string("{\"finished\": ") + (finished ? "true" : "false") +
               ", \"signature\": {\"person\": \"Ada\", \"date\": \"today\", \"consent\": " + consent +
               ", \"geometry_fingerprint\": \"" + fingerprint(geometry) + "\"}}";
    }

    std::filesystem::path file =
        std::filesystem::temp_directory_path() / ("protocol-" + std::to_string(getpid()) + ".json");
    device::DeviceGeometry geometry = device::built_in_geometry("SpidarG6X4");
};

TEST_F(Protocol, HoldsIfAPersonHasSignedForThisGeometry) {
    write(sign());
    const DeviceProtocol protocol = read_protocol(file, geometry);
    EXPECT_TRUE(protocol.holds()) << protocol.lacks;
    EXPECT_EQ(protocol.person, "Ada");
}

TEST_F(Protocol, EndsWhenAnyValueOfTheGeometryChanges) {
    write(sign());
    std::vector<device::DeviceGeometry> others(5, geometry);
    others[0].strings[3].metres_per_count *= -1.0;
    others[1].strings[7].newtons_per_code = std::nextafter(geometry.strings[7].newtons_per_code, 1.0);
    others[2].maximum_tension += 1.0;
    std::swap(others[3].motor_channels[0], others[3].motor_channels[1]);
    others[4].strings[0].grip.z += 1e-9;
    for (const device::DeviceGeometry& other : others) {
        EXPECT_THAT(read_protocol(file, other).lacks, HasSubstr("was signed for another geometry"));
    }
}

TEST_F(Protocol, DoesNotHoldUnfinishedUnsignedMissingOrBroken) {
    write(sign(false));
    EXPECT_THAT(read_protocol(file, geometry).lacks, HasSubstr("is not signed"));
    write(sign(true, "false"));
    EXPECT_THAT(read_protocol(file, geometry).lacks, HasSubstr("is not signed"));
    for (const char* broken :
         {"", "{", "[]", "7", "{\"finished\": \"yes\"}", "{\"signature\": 3, \"finished\": true}"}) {
        write(broken);
        EXPECT_FALSE(read_protocol(file, geometry).holds()) << broken;
    }
    std::filesystem::remove(file);
    EXPECT_THAT(read_protocol(file, geometry).lacks, HasSubstr("is missing"));
    EXPECT_THAT(read_protocol({}, geometry).lacks, HasSubstr("no particular device"));
}

TEST_F(Protocol, LiesBesideTheGeometryFile) {
    EXPECT_EQ(protocol_beside("devices/mine.toml"), "devices/mine.protocol.json");
    EXPECT_EQ(protocol_beside("SpidarG6X4"), "");
}

TEST(Commissioning, OnlyLowersTheLimits) {
    TickSettings settings;
    EXPECT_EQ(commissioning(settings).limits.force, 1.0);
    EXPECT_EQ(commissioning(settings).limits.torque, 0.02);
    EXPECT_TRUE(commissioning(settings).commissioning);
    settings.limits.force = 0.5;
    EXPECT_EQ(commissioning(settings).limits.force, 0.5);
}

}  // namespace
}  // namespace haptic::rt
