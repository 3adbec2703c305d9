#include "haptic/gpio.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

namespace haptic {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

GpioLine line_of_nowhere() {
    return {.chip = "no-such-chip", .line = "3", .purpose = "tick probe (probes.chip, probes.tick)", .user = "test"};
}

TEST(Gpio, SaysWhichChipItDidNotFindForWhatAndHowToListThem) {
    // On any machine, with and without root: no chip has this name.
    const auto says_all = ThrowsMessage<std::runtime_error>(
        AllOf(HasSubstr("'no-such-chip'"), HasSubstr("probes.chip, probes.tick"), HasSubstr("gpio")));
    EXPECT_THAT([] { (void)open_output_line(line_of_nowhere()); }, says_all);
    EXPECT_THAT([] { (void)open_input_line(line_of_nowhere(), GpioBias::Up); }, says_all);
    EXPECT_THAT([] { (void)open_edge_source(line_of_nowhere(), EdgeKind::Rising); }, says_all);
}

TEST(Gpio, RefusesAFileThatIsNoChip) {
    GpioLine line = line_of_nowhere();
    line.chip = "/dev/null";
    EXPECT_THAT([&line] { (void)open_output_line(line); },
                ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("'/dev/null'"), HasSubstr("gpiodetect"))));
}

}  // namespace
}  // namespace haptic
