#include "haptic/probe.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <memory>
#include <stdexcept>
#include <utility>

#include "fake_lines.hpp"

namespace haptic {
namespace {

using test::FakeOutput;
using test::FakeWire;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

// ns by which each call advances the clock.
std::int64_t clock_step_ns = 0;
std::int64_t clock_ns = 0;
std::int64_t stepping_clock() HAPTIC_RT {
    clock_ns += clock_step_ns;
    return clock_ns;
}

Probe probe_on(FakeWire& wire, std::int64_t edge_ns = 300, std::int64_t slowest_edge_ns = Probe::kSlowestEdgeNs) {
    clock_step_ns = edge_ns;
    return {std::make_unique<FakeOutput>(wire), "tick probe", &stepping_clock, slowest_edge_ns};
}

TEST(Probe, MakesOneCallForEachEdgeAndNoneWhereTheLineStands) {
    const auto wire = std::make_unique<FakeWire>();
    Probe probe = probe_on(*wire);
    const std::uint64_t trials = wire->calls;
    probe.set(false);
    EXPECT_EQ(wire->calls, trials) << "it is down already";
    probe.set(true);
    EXPECT_TRUE(wire->is_up());
    probe.set(true);
    probe.toggle();
    EXPECT_FALSE(wire->is_up());
    probe.toggle();
    EXPECT_TRUE(wire->is_up());
    EXPECT_EQ(wire->calls, trials + 3);
    EXPECT_EQ(probe.edges(), 3u);
    EXPECT_EQ(wire->edges().size(), 3u) << "the trials made none";
    EXPECT_TRUE(probe.present());
    EXPECT_FALSE(probe.off());
}

TEST(Probe, LeavesTheLineLow) {
    const auto wire = std::make_unique<FakeWire>();
    {
        Probe first = probe_on(*wire);
        first.set(true);
        Probe second = std::move(first);
        EXPECT_TRUE(wire->is_up()) << "only handed on";
        EXPECT_TRUE(second.up());
    }
    EXPECT_FALSE(wire->is_up());
}

TEST(Probe, IsOffForGoodOnceTheKernelRefuses) {
    const auto wire = std::make_unique<FakeWire>();
    Probe probe = probe_on(*wire);
    probe.set(true);
    probe.set(false);
    wire->error = EIO;
    probe.set(true);
    EXPECT_TRUE(probe.off());
    EXPECT_EQ(probe.error(), EIO);
    EXPECT_EQ(probe.edges(), 2u) << "those that were made";
    wire->error = 0;
    const std::uint64_t calls = wire->calls;
    for (int i = 0; i < 10; ++i) {
        probe.toggle();
    }
    EXPECT_EQ(wire->calls, calls) << "nothing is asked of the kernel any more";
    EXPECT_TRUE(probe.off());
}

TEST(Probe, WithoutALineDoesNothing) {
    Probe probe;
    probe.set(true);
    probe.toggle();
    EXPECT_FALSE(probe.present());
    EXPECT_FALSE(probe.off());
    EXPECT_EQ(probe.edges(), 0u);
    EXPECT_FALSE(open_probe(std::nullopt, &stepping_clock, Probe::kSlowestEdgeNs).present());
}

TEST(Probe, RefusesALineThatTheKernelRefusesInTheTrial) {
    const auto wire = std::make_unique<FakeWire>();
    wire->error = EPERM;
    EXPECT_THAT([&wire] { (void)probe_on(*wire); },
                ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("tick probe"), HasSubstr("not permitted"))));
}

TEST(Probe, RefusesALineThatIsAsSlowAsOneBehindI2c) {
    const auto wire = std::make_unique<FakeWire>();
    EXPECT_NO_THROW((void)probe_on(*wire, Probe::kSlowestEdgeNs));
    EXPECT_THAT(
        [&wire] { (void)probe_on(*wire, Probe::kSlowestEdgeNs + 1000); },
        ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("tick probe"), HasSubstr("201 us"), HasSubstr("I2C"))));
}

TEST(Probe, TakesALineAsSlowAsIsAllowed) {
    const auto wire = std::make_unique<FakeWire>();
    EXPECT_NO_THROW((void)probe_on(*wire, 2'500'000, 2'500'000));
    EXPECT_THAT([&wire] { (void)probe_on(*wire, 2'501'000, 2'500'000); },
                ThrowsMessage<std::runtime_error>(
                    AllOf(HasSubstr("2501 us, more than the 2500 us"), HasSubstr("probes.slowest_edge_s"))));
}

TEST(ProbeLine, MayBeAsSlowAsTheConfigurationSays) {
    const auto slowest_of = [](const char* text) {
        ProbeSettings settings;
        probe_settings().read(Config::parse(text, "test.toml"), settings);
        return settings.slowest_edge_ns;
    };
    EXPECT_EQ(slowest_of(""), Probe::kSlowestEdgeNs);
    EXPECT_EQ(slowest_of("[probes]\nslowest_edge_s = 0.01\n"), 10'000'000);
    EXPECT_THAT([&slowest_of] { (void)slowest_of("[probes]\nslowest_edge_s = 0.2\n"); },
                ThrowsMessage<ConfigError>(AllOf(HasSubstr("test.toml:2: probes.slowest_edge_s"), HasSubstr("0.1"))));
}

TEST(ProbeLine, IsANameOrAnOffset) {
    const auto line_of = [](const char* text) {
        return read_probe_line(Config::parse(text, "test.toml"), "tick", "rt-core");
    };
    EXPECT_EQ(line_of(""), std::nullopt);
    EXPECT_EQ(line_of("[probes]\nchip = \"pl061\"\ntick = \"\"\n"), std::nullopt);
    EXPECT_EQ(line_of("[probes]\nchip = \"pl061\"\ntick = 5\n")->line, "5");
    EXPECT_EQ(line_of("[probes]\nchip = \"pl061\"\ntick = \"5\"\n")->line, "5");
    const std::optional<GpioLine> named = line_of("[probes]\nchip = \"pl061\"\ntick = \"GPIO17\"\n");
    EXPECT_EQ(named->line, "GPIO17");
    EXPECT_EQ(named->chip, "pl061");
    EXPECT_EQ(named->user, "rt-core tick");
    EXPECT_THAT(named->purpose, AllOf(HasSubstr("probes.chip"), HasSubstr("probes.tick")));
}

TEST(ProbeLine, IsRefusedWithoutItsChipOrOutOfRange) {
    const auto read = [](const char* text) {
        (void)read_probe_line(Config::parse(text, "test.toml"), "tick", "rt-core");
    };
    EXPECT_THAT([&read] { read("[probes]\ntick = 5\n"); },
                ThrowsMessage<ConfigError>(AllOf(HasSubstr("test.toml:2: probes.tick"), HasSubstr("probes.chip"))));
    EXPECT_THAT([&read] { read("[probes]\nchip = \"pl061\"\ntick = -1\n"); },
                ThrowsMessage<ConfigError>(HasSubstr("probes.tick")));
}

}  // namespace
}  // namespace haptic
