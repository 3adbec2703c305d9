#include "emulated/motor_recording.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "codecs/sh4_codec.hpp"
#include "emulated/sh4_firmware.hpp"
#include "haptic/csv.hpp"

namespace haptic::device {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

class Recorded : public testing::Test {
  protected:
    Recorded() { std::filesystem::remove(file); }
    ~Recorded() override { std::filesystem::remove(file); }
    void send(std::uint16_t first, std::int64_t now_ns, MotorRecording& recording) {
        Sh4Command command;
        command.dac_codes[0] = first;
        Sh4Packet packet;
        encode(command, packet);
        recording.receive(packet, now_ns);
    }

    std::string file = testing::TempDir() + "motors-" + std::to_string(getpid()) + ".csv";
    EmulatedDevice device{{.geometry = spidar_g6_x3r()}};
    Sh4Firmware firmware{device};
};

TEST_F(Recorded, HasARowForEachChangeThatReachedTheMotorsAndIsCompleteWhileItGrows) {
    MotorRecording recording(firmware, device, file);
    send(45, 5'000'000'001, recording);
    send(45, 5'001'000'000, recording);
    send(45, 5'002'000'000, recording);
    send(4095, 5'003'000'000, recording);
    send(5000, 5'004'000'000, recording);  // refused by the firmware: more than 12 bits
    send(0, 6'000'000'000, recording);
    // Read while the recording is open: a killed server has written the same.
    const CsvTable table = CsvTable::load(file);
    EXPECT_THAT(table.column("code_0"), ElementsAre(0.0, 45.0, 4095.0, 0.0));
    EXPECT_EQ(table.column("code_7").size(), 4u);
    EXPECT_DOUBLE_EQ(table.column("time_s")[1], 5.000000001);
    EXPECT_DOUBLE_EQ(table.column("time_s")[3], 6.0);
    EXPECT_NO_THROW(recording.require_complete());
}

TEST_F(Recorded, AFileThatCannotBeWrittenIsNamed) {
    EXPECT_THAT([&] { MotorRecording(firmware, device, "/nowhere/motors.csv"); },
                ThrowsMessage<std::runtime_error>(HasSubstr("/nowhere/motors.csv")));
}

TEST_F(Recorded, AFullDiskEndsTheRecordingAndNotTheBoard) {
    if (!std::filesystem::exists("/dev/full")) {
        GTEST_SKIP() << "this machine has no /dev/full";
    }
    EXPECT_THROW(MotorRecording(firmware, device, "/dev/full"), std::runtime_error);
}

}  // namespace
}  // namespace haptic::device
