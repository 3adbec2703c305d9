#include "process/idle_request.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

namespace haptic::rt {
namespace {

/// Temporary file in place of /dev/cpu_dma_latency.
class IdleRequestTest : public testing::Test {
  protected:
    void SetUp() override { std::ofstream(file).put('\0'); }
    void TearDown() override { std::filesystem::remove(file); }

    const std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / ("cpu_dma_latency-" + std::to_string(getpid()));
};

TEST_F(IdleRequestTest, WritesTheTimeAsTheKernelReadsIt) {
    const IdleRequest request(250, file);
    EXPECT_TRUE(request.granted());
    std::int32_t written = -1;
    std::ifstream(file, std::ios::binary).read(reinterpret_cast<char*>(&written), sizeof written);
    EXPECT_EQ(written, 250);
}

TEST_F(IdleRequestTest, RequestsNothingForANegativeTime) {
    EXPECT_FALSE(IdleRequest(-1, file).granted());
    EXPECT_EQ(std::filesystem::file_size(file), 1U);
}

TEST_F(IdleRequestTest, ToleratesAKernelWithoutTheFile) {
    EXPECT_FALSE(IdleRequest(0, file / "missing").granted());
}

}  // namespace
}  // namespace haptic::rt
