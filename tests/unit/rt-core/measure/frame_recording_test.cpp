#include "measure/frame_recording.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <random>

#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using testing::HasSubstr;

class FrameRecording : public testing::Test {
  protected:
    void SetUp() override { std::filesystem::create_directory(folder); }
    void TearDown() override { std::filesystem::remove_all(folder); }

    void write(const std::vector<RecordedFrame>& frames) {
        FrameWriter writer(file);
        for (const RecordedFrame& frame : frames) {
            writer.write(frame);
        }
        writer.close();
    }
    std::vector<RecordedFrame> read() {
        FrameReader reader(file);
        std::vector<RecordedFrame> frames(1);
        while (reader.next(frames.back())) {
            frames.emplace_back();
        }
        frames.pop_back();
        return frames;
    }
    std::string error_of(const std::string& content) {
        std::ofstream(file) << content;
        try {
            read();
        } catch (const CsvError& error) {
            return error.what();
        }
        return "";
    }

    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("haptic-frames-" + std::to_string(getpid()));
    std::filesystem::path file = folder / "run.frames.csv";
};

/// Any finite number, sometimes -0.0.
double any_number(std::mt19937_64& random) {
    double value = std::bit_cast<double>(random());
    while (!std::isfinite(value)) {
        value = std::bit_cast<double>(random());
    }
    return random() % 20 == 0 ? -0.0 : value;
}

/// Any finite float, sometimes -0.0.
float any_float(std::mt19937_64& random) {
    float value = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
    while (!std::isfinite(value)) {
        value = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
    }
    return random() % 20 == 0 ? -0.0F : value;
}

RecordedFrame any_frame(std::mt19937_64& random) {
    RecordedFrame recorded;
    recorded.now_ns = static_cast<std::int64_t>(random() >> 1);
    ContactFrame& frame = recorded.frame;
    frame.sequence = random();
    frame.session = random();
    frame.state_sequence = random();
    frame.state_time_ns = static_cast<std::int64_t>(random());
    frame.plane_time_ns = static_cast<std::int64_t>(random());
    frame.publish_time_ns = static_cast<std::int64_t>(random());
    frame.step_ns = static_cast<std::int64_t>(random());
    for (double* const value : {&frame.stiffness, &frame.torque_stiffness, &frame.static_friction,
                                &frame.dynamic_friction, &frame.body_work}) {
        *value = any_number(random);
    }
    frame.proxy_count = static_cast<std::uint32_t>(random() % (kMaxProxies + 1));
    frame.flags = static_cast<std::uint32_t>(random());
    for (std::size_t i = 0; i < frame.proxy_count; ++i) {
        ProxyContact& proxy = frame.proxies[i];
        for (int k = 0; k < 3; ++k) {
            proxy.rest_offset[k] = any_number(random);
            proxy.rest_velocity[k] = any_number(random);
            proxy.position[k] = any_number(random);
            proxy.surface_velocity[k] = any_number(random);
        }
        proxy.radius = any_number(random);
        proxy.in_contact = static_cast<std::uint32_t>(random() % 2);
        proxy.plane_count = static_cast<std::uint32_t>(random() % (kMaxPlanes + 1));
        for (std::size_t k = 0; k < proxy.plane_count; ++k) {
            for (double& value : proxy.planes[k].normal) {
                value = any_number(random);
            }
            proxy.planes[k].offset = any_number(random);
            proxy.planes[k].velocity = any_number(random);
        }
    }
    // Every third frame has no compliance.
    frame.reserved = static_cast<std::uint32_t>(random());
    frame.compliance_rows = random() % 3 == 0 ? 0 : static_cast<std::uint32_t>(random() % (kMaxComplianceRows + 1));
    for (std::size_t i = 0; i < compliance_index(frame.compliance_rows, 0); ++i) {
        frame.compliance[i] = any_float(random);
    }
    return recorded;
}

TEST_F(FrameRecording, GivesTheSameBitsBack) {
    std::mt19937_64 random(5);
    std::vector<RecordedFrame> frames(40);
    std::generate(frames.begin(), frames.end(), [&random] { return any_frame(random); });
    write(frames);
    const std::vector<RecordedFrame> again = read();
    ASSERT_EQ(again.size(), frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) {
        EXPECT_EQ(again[i].now_ns, frames[i].now_ns);
        EXPECT_EQ(again[i].defect, FrameDefect::None);
        EXPECT_EQ(std::memcmp(&again[i].frame, &frames[i].frame, sizeof(ContactFrame)), 0) << "frame " << i;
    }
}

TEST_F(FrameRecording, KeepsADefectiveFrameDefective) {
    std::vector<RecordedFrame> frames(4);
    for (RecordedFrame& recorded : frames) {
        recorded.frame = test::floor_frame(0.0, 100.0, 7);
    }
    frames[0].frame.proxies[0].planes[0].offset = std::numeric_limits<double>::quiet_NaN();
    frames[1].frame.proxy_count = 4'000'000'000;
    frames[2].frame.stiffness = -std::numeric_limits<double>::infinity();
    frames[3].frame.proxies[0].radius = -0.01;
    for (RecordedFrame& recorded : frames) {
        recorded.defect = find_defect(recorded.frame);
        ASSERT_NE(recorded.defect, FrameDefect::None);
    }
    write(frames);
    const std::vector<RecordedFrame> again = read();
    ASSERT_EQ(again.size(), 4u);
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(again[i].defect, frames[i].defect);
        EXPECT_NE(find_defect(again[i].frame), FrameDefect::None);
    }
}

TEST_F(FrameRecording, IsReadableAsATable) {
    std::mt19937_64 random(6);
    RecordedFrame broken = any_frame(random);
    broken.frame.stiffness = std::numeric_limits<double>::quiet_NaN();
    write({any_frame(random), broken});
    EXPECT_NO_THROW(static_cast<void>(CsvTable::load(file)));
    EXPECT_NO_THROW(static_cast<void>(CsvTable::load(compliance_file(file))));
}

TEST_F(FrameRecording, HasNoFileOfCompliancesIfNoFrameHasOne) {
    RecordedFrame limp;
    limp.frame = test::floor_frame(0.0, 100.0, 7);
    write({limp});
    EXPECT_EQ(compliance_file(file), folder / "run.compliance.csv");
    EXPECT_FALSE(std::filesystem::exists(compliance_file(file)));
    EXPECT_EQ(read().size(), 1u);
}

TEST_F(FrameRecording, RemovesTheCompliancesOfAnEarlierRecording) {
    RecordedFrame limp;
    limp.frame = test::floor_frame(0.0, 100.0, 7);
    RecordedFrame stiff = limp;
    stiff.frame.compliance_rows = 1;
    stiff.frame.compliance[0] = 1.0F;
    write({stiff});
    ASSERT_TRUE(std::filesystem::exists(compliance_file(file)));
    write({limp});
    EXPECT_FALSE(std::filesystem::exists(compliance_file(file)));
    EXPECT_EQ(read().size(), 1u);
}

TEST_F(FrameRecording, EndsAsAfterAFailedWriteIfTheCompliancesCannotBeOpened) {
    RecordedFrame stiff;
    stiff.frame = test::floor_frame(0.0, 100.0, 7);
    FrameWriter writer(file);
    writer.write(stiff);
    EXPECT_TRUE(writer.flush());
    // Something else has taken the name meanwhile.
    std::filesystem::create_directory(compliance_file(file));
    stiff.frame.compliance_rows = 1;
    stiff.frame.compliance[0] = 1.0F;
    EXPECT_NO_THROW(writer.write(stiff));
    EXPECT_NO_THROW(writer.write(stiff));
    EXPECT_FALSE(writer.flush());
    EXPECT_THROW(writer.close(), std::runtime_error);
    EXPECT_EQ(CsvTable::load(file).rows(), 1u) << "a frame without its compliance is no part of the recording";
}

TEST_F(FrameRecording, NamesTheColumnsOfTheComplianceByNumber) {
    EXPECT_EQ(compliance_columns().size(), 2 + kMaxComplianceRows);
    EXPECT_EQ(compliance_columns()[2], "column0");
    EXPECT_EQ(compliance_columns().back(), "column191");
}

TEST_F(FrameRecording, RefusesFramesWhoseComplianceIsMissing) {
    RecordedFrame stiff;
    stiff.now_ns = 5;
    stiff.frame = test::floor_frame(0.0, 100.0, 7);
    stiff.frame.compliance_rows = 1;
    stiff.frame.compliance[0] = 0.01F;
    write({stiff, stiff});
    std::string text;
    {
        std::ifstream stream(compliance_file(file));
        std::string line;
        std::getline(stream, line);
        text = line + "\n";
        std::getline(stream, line);
        text += line + "\n";
    }
    std::ofstream(compliance_file(file)) << text;
    FrameReader reader(file);
    RecordedFrame frame;
    EXPECT_TRUE(reader.next(frame));
    EXPECT_EQ(frame.frame.compliance[0], 0.01F);
    EXPECT_THROW(reader.next(frame), CsvError) << "the second frame has none";
    std::filesystem::remove(compliance_file(file));
    EXPECT_THROW(read(), CsvError);
}

TEST_F(FrameRecording, RefusesRecordingsOfEarlierVersions) {
    for (const char* const added : {"compliance_rows", "body_work_j", "radius_m"}) {
        std::string header = "now_ns,defect,particle";
        for (std::size_t i = 3; i < frame_columns().size(); ++i) {
            header += frame_columns()[i] == added ? "" : "," + frame_columns()[i];
        }
        EXPECT_THAT(error_of(header + "\n"), HasSubstr(std::string("there is no column ") + added));
    }
}

TEST_F(FrameRecording, IgnoresColumnsThatItDoesNotKnow) {
    std::string header = "now_ns,damping_ns_m,defect,particle";
    std::string numbers = "8,2.5,0,-1";
    for (std::size_t i = 3; i < frame_columns().size(); ++i) {
        header += "," + frame_columns()[i];
        numbers += frame_columns()[i] == "stiffness_n_m" ? ",300" : ",0";
    }
    std::ofstream(file) << header + ",rotational_damping_nms_rad\n" + numbers + ",0.5\n";
    const std::vector<RecordedFrame> frames = read();
    ASSERT_EQ(frames.size(), 1u);
    RecordedFrame expected;
    expected.frame.stiffness = 300.0;
    EXPECT_EQ(frames[0].now_ns, 8);
    EXPECT_EQ(std::memcmp(&frames[0].frame, &expected.frame, sizeof(ContactFrame)), 0);
}

TEST_F(FrameRecording, NamesTheLineOfRowsThatFormNoFrame) {
    EXPECT_THAT(error_of("now_ns,defect\n"), HasSubstr("there is no column particle"));
    std::string header;
    std::string zeros;
    for (std::size_t i = 3; i < frame_columns().size(); ++i) {
        header += "," + frame_columns()[i];
        zeros += frame_columns()[i] == "proxy_count" ? ",2" : ",0";
    }
    header = "now_ns,defect,particle" + header + "\n";
    EXPECT_EQ(error_of(header + "1,0,0" + zeros + "\n"), "");  // the end of a killed run
    EXPECT_THAT(error_of(header + "1,0,0" + zeros + "\n1,0,2" + zeros + "\n"),
                HasSubstr("csv:3: column particle: expected 1"));
    EXPECT_THAT(error_of(header + "1,99,0" + zeros + "\n"), HasSubstr("csv:2: column defect: unknown defect 99"));
    EXPECT_EQ(error_of(header + "1,0,0" + zeros + "\n1,0,1" + zeros + "\n"), "");
}

}  // namespace
}  // namespace haptic::rt
