// Fault table: injects each fault into the emulated board or device while the hand presses into a floor, and measures
// the force and its rate of change at the device, from the actual string tensions. Prints the table of the
// documentation:
//     build/release/tests/integration/fault_table_test
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "haptic/clock.hpp"
#include "haptic/csv.hpp"
#include "haptic/device/emulated_board.hpp"
#include "haptic/device/fault.hpp"
#include "haptic/ring.hpp"
#include "measure/recording.hpp"
#include "measure/run_report.hpp"
#include "process/held_hand.hpp"
#include "process/loop.hpp"
#include "process/motor_gate.hpp"
#include "process/watchdog.hpp"
#include "ring_session.hpp"
#include "tick/tick.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kTickNs = 1'000'000;
constexpr double kDacCodeN = 1.0 / (0.365296803653 * 415.0);  // N, tension of one DAC code
constexpr double kDacCodes = 8.0 * kDacCodeN;                 // N: eight strings, each truncated by up to one code
constexpr int kInjectTick = 1500;                             // ticks after the loop is running
constexpr double kInjectS = 1.5;

std::int64_t still_clock() HAPTIC_RT {
    return 0;
}

/// Hand that moves 2 cm down, 5 mm into a floor, and then sideways at 0.1 m/s, back and forth for 12 s.
PoseTrack pressing_hand() {
    std::vector<double> times{0.0, 0.3};
    std::vector<Pose> poses{Pose{}, Pose{{0.0, -0.02, 0.0}, Quat(1, 0, 0, 0)}};
    for (int i = 0; i < 60; ++i) {
        times.push_back(0.5 + 0.2 * i);
        poses.push_back({{i % 2 == 0 ? -0.01 : 0.01, -0.02, 0.004}, Quat(1, 0, 0, 0)});
    }
    return {std::move(times), std::move(poses)};
}

ContactFrame floor_frame(std::int64_t now_ns) {
    ContactFrame frame{};
    frame.state_time_ns = now_ns;
    frame.plane_time_ns = now_ns;
    frame.publish_time_ns = now_ns;
    frame.step_ns = 10'000'000;
    frame.stiffness = 400.0;
    frame.proxy_count = 1;
    frame.proxies[0].plane_count = 1;
    frame.proxies[0].planes[0].normal[1] = 1.0;
    frame.proxies[0].planes[0].offset = -0.015;
    return frame;
}

/// State of a run that a case may change, tick by tick.
struct Turn {
    device::EmulatedBoard* board;
    Tick* tick;
    TickTime* time;
    ContactFrame* frame;
    bool* publish;
    int after;  // ticks since the fault began
};

struct Case {
    std::string name;
    std::string fault;            // for parse_fault(), without its time; empty: `act` injects it
    std::uint32_t bits = 0;       // at least one of these faults must be reported; 0: none
    double slew_allowance = 0.0;  // N in 1 ms above the rate limit, with the reason:
    const char* because = "";
    std::function<void(const Turn&)> act = nullptr;
    std::function<void(TickSettings&)> set = nullptr;
    std::uint32_t flag = 0;        // HAPTIC_TICK_* flag that reports it if it is no fault
    double force_allowance = 0.0;  // N above the force before the fault
};

struct Row {
    std::string name;
    std::string named;
    double detected_ms = -1.0;
    double before_n = 0.0;
    double force_n = 0.0;
    double slew_n_per_ms = 0.0;
    std::string state;
    double settled_ms = -1.0;  // time from the fault until the force is gone; -1: never
    double left_n = 0.0;       // force at the end
};

void print(const std::vector<Row>& rows) {
    std::printf(
        "\n| injected | named | detected after, ms | force before, N | largest force, N | largest change, N/ms "
        "| state reached | force left, N |\n|---|---|---|---|---|---|---|---|\n");
    for (const Row& row : rows) {
        std::string detected = "-";
        if (row.detected_ms >= 0.0) {
            std::array<char, 32> text{};
            std::snprintf(text.data(), text.size(), "%.0f", row.detected_ms);
            detected = text.data();
        }
        std::array<char, 64> settled{};
        if (row.settled_ms >= 0.0) {
            std::snprintf(settled.data(), settled.size(), " after %.0f ms", row.settled_ms);
        }
        std::printf("| %s | %s | %s | %.2f | %.2f | %.2f | %s%s | %.2f |\n", row.name.c_str(), row.named.c_str(),
                    detected.c_str(), row.before_n, row.force_n, row.slew_n_per_ms, row.state.c_str(), settled.data(),
                    row.left_n);
    }
    std::fflush(stdout);
}

std::string joined(const std::vector<std::string>& names) {
    std::string text;
    for (const std::string& name : names) {
        text += (text.empty() ? "" : ", ") + name;
    }
    return text.empty() ? "-" : text;
}

/// Checks that the last two seconds are on disk, with the fault in the last row.
void expect_black_box(const BlackBox& box, std::uint32_t bits, const std::string& name, std::size_t min_rows) {
    const std::filesystem::path file =
        std::filesystem::temp_directory_path() / ("haptic-fault-table-" + std::to_string(getpid()) + ".csv");
    write_black_box(file, box);
    const CsvTable table = CsvTable::load(file);
    std::filesystem::remove(file);
    EXPECT_GE(table.rows(), min_rows) << name;
    const auto last = static_cast<std::uint32_t>(table.column("faults").back());
    EXPECT_EQ(last & bits, bits) << name;
    EXPECT_EQ(table.column("safety_state").back(), HAPTIC_DISARMED) << name;
}

Row run(const Case& what) {
    TickSettings settings;
    if (what.set) {
        what.set(settings);
    }
    std::vector<device::Fault> faults;
    if (!what.fault.empty()) {
        std::string text = what.fault;
        const std::size_t end = text.find_first_of("/:");
        text.insert(end == std::string::npos ? text.size() : end, "@" + std::to_string(kInjectS));
        faults.push_back(device::parse_fault(text));
    }
    device::EmulatedBoard board({.geometry = settings.geometry,
                                 .hand = pressing_hand(),
                                 .power_up = {100, 65500, 3, 40000, 0, 7, 12345, 65535},
                                 .hand_waits = true,
                                 .faults = faults,
                                 .faults_wait = true});
    HeldHandBoard held(board);
    const haptic::test::RingSession session;
    RingReader<ContactFrame> frames_in(session.name());
    RingWriter<DeviceState> states(session.name());
    RingWriter<ContactFrame> frames_out(session.name());
    Tick tick(settings, held, frames_in, states, still_clock);
    held.attach(tick);

    Row row;
    row.name = what.name;
    std::int64_t now_ns = 1'000'000'000;
    int running_ticks = 0;  // since the hand was released
    Wrench last;
    std::uint32_t seen_flags = 0;
    tick.arm();
    for (int i = 0; i < 5000; ++i) {
        const int after = running_ticks - kInjectTick;
        TickTime time{now_ns, now_ns, 0};
        ContactFrame frame = floor_frame(now_ns);
        bool publish = true;
        if (after >= 0 && what.act) {
            what.act({&board, &tick, &time, &frame, &publish, after});
        }
        if (publish) {
            frames_out.publish(frame, time.now_ns);
        }
        tick.run(time);
        now_ns = time.now_ns + kTickNs;
        running_ticks += running_ticks > 0 || tick.safety_state() == SafetyState::Running ? 1 : 0;

        const Wrench made = board.device().wrench();
        const double force = glm::length(made.force);
        if (after < 0) {
            row.before_n = force;
        } else {
            row.force_n = std::max(row.force_n, force);
            row.slew_n_per_ms = std::max(row.slew_n_per_ms, glm::length(made.force - last.force));
            const bool named = (tick.faults() & what.bits) != 0 || (tick.last().flags & what.flag) != 0;
            if (named && row.detected_ms < 0.0) {
                row.detected_ms = after;
            }
            if (force == 0.0 && row.settled_ms < 0.0) {
                row.settled_ms = after;
            }
            seen_flags |= tick.last().flags;
        }
        last = made;
        if (after > 2800) {
            break;
        }
    }
    row.left_n = glm::length(last.force);
    row.named = joined(fault_names(tick.faults()));
    if (what.flag != 0 && tick.faults() == 0) {
        row.named = (seen_flags & HAPTIC_TICK_FRAME_STALE) != 0 ? "frames_stale" : "exchange failed (flag)";
    }
    row.state = state_name(tick.safety_state());

    EXPECT_NEAR(row.before_n, 2.0, 0.2) << what.name << ": the hand did not press";
    if (what.bits != 0) {
        EXPECT_NE(tick.faults() & what.bits, 0u) << what.name;
        EXPECT_EQ(tick.safety_state(), SafetyState::Disarmed) << what.name;
        expect_black_box(tick.black_box(), tick.faults() & what.bits, what.name, 2000);
    } else {
        EXPECT_EQ(tick.safety_state(), SafetyState::Running) << what.name;
        EXPECT_TRUE(what.flag == 0 || (seen_flags & what.flag) != 0) << what.name;
    }
    // A fault must not increase the floor's force nor break a limit.
    EXPECT_LE(row.force_n, row.before_n + 0.2 + what.force_allowance) << what.name;
    EXPECT_LE(row.force_n, settings.limits.force + kDacCodes) << what.name;
    EXPECT_LE(row.slew_n_per_ms, settings.limits.force_rate * 1e-3 + 2.0 * kDacCodes + what.slew_allowance)
        << what.name;
    return row;
}

std::vector<Case> cases() {
    constexpr const char* kHeld = "motors hold what they have until something reaches them again";
    std::vector<Case> list;
    list.push_back(
        {.name = "answers lost for 4 ms", .fault = "drop/0.004:way=in", .flag = HAPTIC_TICK_EXCHANGE_FAILED});
    list.push_back({.name = "answers lost", .fault = "drop:way=in", .bits = HAPTIC_FAULT_EXCHANGE});
    list.push_back({.name = "answers lost for 50 ms", .fault = "drop/0.05:way=in", .bits = HAPTIC_FAULT_EXCHANGE});
    list.push_back({.name = "commands lost", .fault = "drop:way=out", .bits = HAPTIC_FAULT_EXCHANGE});
    list.push_back({.name = "commands lost for 50 ms",
                    .fault = "drop/0.05:way=out",
                    .bits = HAPTIC_FAULT_EXCHANGE,
                    .slew_allowance = 2.0,
                    .because = kHeld});
    list.push_back({.name = "answers cut short", .fault = "truncate:way=in", .bits = HAPTIC_FAULT_EXCHANGE});
    list.push_back({.name = "commands cut short", .fault = "truncate:way=out", .bits = HAPTIC_FAULT_EXCHANGE});
    list.push_back({.name = "answers 20 ms late", .fault = "delay:way=in,by=0.02", .bits = HAPTIC_FAULT_EXCHANGE});
    list.push_back({.name = "cable out", .fault = "unplug", .bits = HAPTIC_FAULT_EXCHANGE});
    list.push_back({.name = "cable out for 0.2 s",
                    .fault = "unplug/0.2",
                    .bits = HAPTIC_FAULT_EXCHANGE,
                    .slew_allowance = 2.0,
                    .because = kHeld});
    list.push_back(
        {.name = "high bit of a counter", .fault = "flip:way=in,bit=143,packets=1", .bits = HAPTIC_FAULT_JUMP});
    list.push_back({.name = "encoder jumps by 50 mm", .fault = "jump:string=2", .bits = HAPTIC_FAULT_JUMP});
    list.push_back({.name = "encoder stands still", .fault = "stuck:string=6", .bits = HAPTIC_FAULT_RESIDUAL});
    list.push_back({.name = "D/A frozen, echo shows it", .fault = "dac:echo=frozen", .bits = HAPTIC_FAULT_EXCHANGE});
    list.push_back({.name = "D/A frozen, echo hides it", .fault = "dac:echo=sent", .force_allowance = 0.3});
    list.push_back({.name = "string slack by 20 mm",
                    .fault = "slack:string=4",
                    .bits = HAPTIC_FAULT_SLACK | HAPTIC_FAULT_RESIDUAL,
                    .slew_allowance = 2.0,
                    .because = "a string that carries nothing any more takes its share of the force along",
                    .force_allowance = 0.5});
    list.push_back({.name = "ticks late", .fault = "", .bits = HAPTIC_FAULT_OVERRUN, .act = [](const Turn& turn) {
                        turn.time->missed = 1;
                    }});
    list.push_back(
        {.name = "force without measure", .fault = "", .bits = HAPTIC_FAULT_NONFINITE, .act = [](const Turn& turn) {
             turn.frame->proxies[0].planes[0].offset = 1e307;
         }});
    list.push_back({.name = "no contact frames",
                    .fault = "",
                    .act = [](const Turn& turn) { *turn.publish = false; },
                    .flag = HAPTIC_TICK_FRAME_STALE});
    list.push_back({.name = "contact frames that are not finite",
                    .fault = "",
                    .act = [](const Turn& turn) { turn.frame->stiffness = std::numeric_limits<double>::quiet_NaN(); },
                    .flag = HAPTIC_TICK_FRAME_STALE});
    list.push_back({.name = "process stands still for 20 s, motors that bear 0.6 N",
                    .fault = "",
                    .bits = HAPTIC_FAULT_THERMAL,
                    .act =
                        [](const Turn& turn) {
                            if (turn.after == 0) {
                                turn.time->now_ns += 20'000'000'000;
                            }
                        },
                    .set = [](TickSettings& settings) { settings.motors.continuous_share = 0.03; }});
    list.push_back({.name = "stop button",
                    .fault = "",
                    .bits = HAPTIC_FAULT_STOP,
                    .act = [](const Turn& turn) { turn.board->device().set_buttons(1); },
                    .set = [](TickSettings& settings) { settings.stop_button = 0; }});
    list.push_back({.name = "stop line, signal", .fault = "", .bits = HAPTIC_FAULT_STOP, .act = [](const Turn& turn) {
                        turn.tick->stop();
                    }});
    return list;
}

/// Board that hangs in an exchange, and shows the motor values to another thread meanwhile.
class HangingBoard final : public device::Board {
  public:
    explicit HangingBoard(device::Board& board) : board_(&board) {}
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override {
        while (hang.load()) {
            hanging.store(true);
        }
        return board_->exchange(command, reading, now_ns);
    }
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override { board_->zero_motors(now_ns); }

    std::atomic<bool> hang{false};
    std::atomic<bool> hanging{false};

  private:
    device::Board* board_;
};

/// Runs in real time, because only a real loop can hang; makes no assertions about durations.
Row run_watchdog() {
    TickSettings settings;
    settings.safety.late_share = 1.0;  // the table below judges lateness
    device::EmulatedBoard board({.geometry = settings.geometry});
    HangingBoard hanging(board);
    MotorGate gate(hanging);
    const haptic::test::RingSession session;
    RingReader<ContactFrame> frames_in(session.name());
    RingWriter<DeviceState> states(session.name());
    RingWriter<ContactFrame> frames_out(session.name());
    Tick tick(settings, gate, frames_in, states, &monotonic_now_ns);
    WatchdogSettings watchdog_settings;
    Watchdog watchdog(watchdog_settings, tick, gate);
    RealtimeLoop loop({.warm_up_ticks = 20}, tick, {});
    loop.start();
    const auto wait = [&](const std::function<bool()>& condition) {
        for (int i = 0; i < 30'000 && !condition(); ++i) {
            ContactFrame frame = floor_frame(monotonic_now_ns());
            frame.proxies[0].planes[0].offset = 0.005;
            frames_out.publish(frame, frame.publish_time_ns);
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    };
    std::int64_t running_ns = 0;
    wait([&] {
        running_ns = running_ns == 0 && loop.safety_state() == SafetyState::Running ? monotonic_now_ns() : running_ns;
        return running_ns != 0 && monotonic_now_ns() - running_ns > 500'000'000;
    });
    Row row;
    row.name = "loop hangs (limit 100 ms)";
    hanging.hang = true;
    const std::int64_t hung_ns = monotonic_now_ns();
    wait([&] { return hanging.hanging.load(); });
    row.before_n = glm::length(board.device().wrench().force);
    wait([&] { return watchdog.fired(); });
    row.detected_ms = 1e-6 * static_cast<double>(monotonic_now_ns() - hung_ns);
    EXPECT_TRUE(watchdog.fired());
    EXPECT_EQ(glm::length(board.device().wrench().force), 0.0);
    row.force_n = row.before_n;
    row.slew_n_per_ms = row.before_n;  // no fade-out, because no tick runs
    row.settled_ms = row.detected_ms;
    hanging.hang = false;
    wait([&] { return loop.finished(); });
    loop.join();
    EXPECT_EQ(glm::length(board.device().wrench().force), 0.0);
    EXPECT_EQ(tick.faults() & HAPTIC_FAULT_WATCHDOG, static_cast<std::uint32_t>(HAPTIC_FAULT_WATCHDOG));
    expect_black_box(tick.black_box(), HAPTIC_FAULT_WATCHDOG, row.name, 100);
    row.named = joined(fault_names(tick.faults()));
    row.state = state_name(tick.safety_state());
    return row;
}

TEST(FaultTable, EveryFaultIsNamedAndFadesWithinTheLimits) {
    std::vector<Row> rows;
    for (const Case& one : cases()) {
        rows.push_back(run(one));
    }
    rows.push_back(run_watchdog());
    print(rows);
}

}  // namespace
}  // namespace haptic::rt
