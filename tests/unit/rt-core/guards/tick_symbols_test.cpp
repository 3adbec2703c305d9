// Symbol check of the tick: functions reachable from it refer only to external symbols on the committed list, so that
// no allocator, lock, stream or exception can hide behind a call, with any compiler.
#include <gtest/gtest.h>

#include <fstream>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "call_graph.hpp"

namespace haptic::test {
namespace {

/// Reads the list: one symbol per line, comments after #.
std::set<std::string> read_allowed(const std::string& file) {
    std::ifstream stream(file);
    if (!stream) {
        throw std::runtime_error("cannot read " + file);
    }
    std::set<std::string> allowed;
    std::string line;
    while (std::getline(stream, line)) {
        line = line.substr(0, line.find('#'));
        line.erase(line.find_last_not_of(" \t") + 1);
        if (!line.empty()) {
            allowed.insert(line);
        }
    }
    return allowed;
}

std::vector<std::string> archives() {
    return {RT_CORE_ARCHIVE, RENDERING_ARCHIVE, FIRMWARE_HOST_ARCHIVE, RING_ARCHIVE, SHARED_ARCHIVE};
}

const CallGraph& tick_graph() {
    static const CallGraph graph(OBJDUMP, NM, archives());
    return graph;
}

/// Entry points of the real-time thread: its loop, and every function that a tick calls through a pointer.
const std::vector<std::string>& roots() {
    static const std::vector<std::string> names = {
        "haptic::rt::RealtimeLoop::cycle",
        "haptic::rt::Tick::run",
        "haptic::device::Sh4Board::exchange",
        "haptic::device::EmulatedTransport::exchange",
        "haptic::device::Sh4Firmware::receive",
        "haptic::device::Sh4Firmware::reply",
        "haptic::device::SimpleBoard::exchange",
        "haptic::device::SimpleFirmware::receive",
        "haptic::device::SimpleFirmware::reply",
        "haptic::rt::HeldHandBoard::exchange",
        "haptic::rt::FrameIntakeInTick::take",
        "haptic::rt::FrameThread::take",
        "haptic::rt::FrameThread::expect",
        "haptic::rt::RingSource<haptic_contact_frame>::read_newest",
        "haptic::rt::RingSource<haptic_wrench_overlay>::read_newest",
        "haptic::monotonic_now_ns",
        "haptic::rt::MotorGate::exchange",
        "haptic::device::FaultyFirmware::receive",
        "haptic::device::FaultyFirmware::reply",
        "haptic::device::FaultyFirmware::connected",
        "haptic::device::UartBoard::exchange",
        "haptic::device::UartFirmware::receive",
        "haptic::device::UartFirmware::reply",
        "haptic::device::SerialTransport::exchange",
        "haptic::device::TtyBoard::exchange",
        "haptic::ContactRows<16ul>::subtract_rows",
        "haptic::ContactRows<16ul>::rotate",
        "haptic::ContactRows<16ul>::find_depths",
        "haptic::ContactRows<16ul>::add_pull",
        "haptic::ContactRows<16ul>::cross",
        "haptic::ContactRows<16ul>::add_power",
        "haptic::ContactRows<16ul>::relative_squares",
#if defined(__x86_64__)
        "haptic::ContactRows<32ul>::subtract_rows",
        "haptic::ContactRows<32ul>::rotate",
        "haptic::ContactRows<32ul>::find_depths",
        "haptic::ContactRows<32ul>::add_pull",
        "haptic::ContactRows<32ul>::cross",
        "haptic::ContactRows<32ul>::add_power",
        "haptic::ContactRows<32ul>::relative_squares",
#endif
    };
    return names;
}

CallGraph::Reach reach_of(const CallGraph& graph, const std::vector<std::string>& names) {
    std::vector<std::string> symbols;
    for (const std::string& name : names) {
        const std::vector<std::string> found = graph.find(name);
        EXPECT_FALSE(found.empty()) << name << " is not in the libraries: was it renamed?";
        symbols.insert(symbols.end(), found.begin(), found.end());
    }
    return graph.reach(symbols);
}

TEST(TickSymbols, AreAllOnTheAllowList) {
    const std::set<std::string> allowed = read_allowed(ALLOWED_SYMBOLS);
    for (const auto& [symbol, user] : reach_of(tick_graph(), roots()).externals) {
        EXPECT_TRUE(allowed.contains(symbol))
            << demangle(user) << "\n  refers to " << demangle(symbol) << " (" << symbol << ")";
    }
}

TEST(TickSymbols, OfTheUsbExchangeAreThoseOfLibusbAndTheKernelAlone) {
    // A separate list: the USB exchange has its own bound, and only it may make these calls.
    std::set<std::string> allowed = read_allowed(ALLOWED_SYMBOLS);
    allowed.insert({"libusb_submit_transfer", "libusb_handle_events_timeout_completed", "ppoll", "sem_post"});
    allowed.insert({"ioctl", "__errno_location"});  // for the last packet
    const std::vector<std::string> usb = {"haptic::device::UsbTransport::exchange",
                                          "haptic::device::UsbTransport::send_last"};
    const CallGraph::Reach reach = reach_of(tick_graph(), usb);
    for (const auto& [symbol, user] : reach.externals) {
        EXPECT_TRUE(allowed.contains(symbol)) << demangle(user) << " refers to " << symbol;
    }
    EXPECT_TRUE(reach.externals.contains("libusb_submit_transfer")) << "the check did not find the expected call";
}

TEST(TickSymbols, OfAProbeEdgeAreOneCallOfLibgpiod) {
    std::set<std::string> allowed = read_allowed(ALLOWED_SYMBOLS);
    allowed.insert(GPIOD_SET_VALUE);
    const CallGraph::Reach reach = reach_of(tick_graph(), {"haptic::(anonymous namespace)::GpioOutput::set"});
    for (const auto& [symbol, user] : reach.externals) {
        EXPECT_TRUE(allowed.contains(symbol)) << demangle(user) << " refers to " << symbol;
    }
    EXPECT_TRUE(reach.externals.contains(GPIOD_SET_VALUE)) << "the check did not find the expected call";
}

#ifdef GPIOD_ARCHIVE
TEST(TickSymbols, OfThatCallOfLibgpiodAreTheKernels) {
    const CallGraph graph(OBJDUMP, NM, {GPIOD_ARCHIVE});
    const CallGraph::Reach reach = reach_of(graph, {GPIOD_SET_VALUE});
    const std::set<std::string> allowed = {"ioctl", "__errno_location", "memset", "__stack_chk_fail", "__assert_fail"};
    for (const auto& [symbol, user] : reach.externals) {
        EXPECT_TRUE(allowed.contains(symbol)) << user << " refers to " << symbol;
    }
    EXPECT_TRUE(reach.externals.contains("ioctl")) << "the check did not find the expected call";
}
#endif

TEST(TickSymbols, ReachEveryPartOfTheTick) {
    // Guard: a check that reaches no function finds nothing.
    const CallGraph::Reach reach = reach_of(tick_graph(), roots());
    for (const char* part :
         {"haptic::rt::sleep_until", "haptic::rt::StringEncoders::update", "haptic::rt::PoseSolver::solve",
          "haptic::FrameRenderer::render", "haptic::ToolContact::render", "haptic::ContactSolver::solve",
          "haptic::project", "haptic::rt::WrenchLimiter::apply", "haptic::rt::SafetyMachine::update",
          "haptic::rt::TensionSolver::solve", "haptic::rt::Recorder::push", "haptic::rt::FrameThread::take",
          "haptic::PreparedFrame::prepare", "haptic::find_defect", "haptic::Probe::set", "haptic::Histogram::record",
          "haptic::PoseTrack::at", "haptic::detail::RingWriterBase::publish_bytes",
          "haptic::detail::RingReaderBase::read_newest_bytes"}) {
        bool reached = false;
        for (const std::string& symbol : tick_graph().find(part)) {
            reached = reached || reach.functions.contains(symbol);
        }
        EXPECT_TRUE(reached) << part;
    }
}

class ForbiddenCalls : public testing::TestWithParam<std::pair<const char*, std::vector<const char*>>> {};

TEST_P(ForbiddenCalls, AreFound) {
    const auto& [function, symbols] = GetParam();
    const CallGraph graph(OBJDUMP, NM, {FORBIDDEN_ARCHIVE});
    const std::set<std::string> allowed = read_allowed(ALLOWED_SYMBOLS);
    const CallGraph::Reach reach = reach_of(graph, {std::string("haptic::test::") + function});
    for (const char* symbol : symbols) {
        EXPECT_TRUE(reach.externals.contains(symbol)) << symbol;
        EXPECT_FALSE(allowed.contains(symbol)) << symbol;
    }
    EXPECT_EQ(reach.externals.empty(), symbols.empty());
}

INSTANTIATE_TEST_SUITE_P(Each, ForbiddenCalls,
                         testing::Values(std::make_pair("forbidden_allocation", std::vector<const char*>{"_Znwm"}),
                                         std::make_pair("forbidden_lock",
                                                        std::vector<const char*>{"pthread_mutex_lock"}),
                                         std::make_pair("forbidden_throw", std::vector<const char*>{"__cxa_throw"}),
                                         std::make_pair("forbidden_print", std::vector<const char*>{"printf"}),
                                         std::make_pair("allowed_arithmetic", std::vector<const char*>{})),
                         [](const auto& param) { return std::string(param.param.first); });

}  // namespace
}  // namespace haptic::test
