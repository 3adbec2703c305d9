#include "process/settings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "haptic/device/device_geometry_file.hpp"

namespace haptic::rt {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;
using testing::UnorderedElementsAreArray;

Settings read(const std::string& toml) {
    return read_settings(Config::parse(toml, "test.toml"));
}

void expect_equal(const Settings& a, const Settings& b) {
    EXPECT_EQ(a.loop.period_ns, b.loop.period_ns);
    EXPECT_EQ(a.loop.priority, b.loop.priority);
    EXPECT_EQ(a.loop.cpu, b.loop.cpu);
    EXPECT_EQ(a.loop.idle_exit_us, b.loop.idle_exit_us);
    EXPECT_EQ(a.loop.warm_up_ticks, b.loop.warm_up_ticks);
    EXPECT_EQ(a.queue_ticks, b.queue_ticks);
    EXPECT_EQ(a.board.check_echo, b.board.check_echo);
    EXPECT_EQ(a.board.simple_phase, b.board.simple_phase);
    EXPECT_EQ(a.watchdog.limit_ns, b.watchdog.limit_ns);
    EXPECT_EQ(a.watchdog.priority, b.watchdog.priority);
    EXPECT_EQ(a.board.uart.padding, b.board.uart.padding);
    EXPECT_EQ(a.board.uart.set_lengths, b.board.uart.set_lengths);
    EXPECT_EQ(a.serial.baud, b.serial.baud);
    EXPECT_EQ(a.serial.timeout_ns, b.serial.timeout_ns);
    EXPECT_EQ(a.tick.stop_button, b.tick.stop_button);
    EXPECT_EQ(a.tick.stop_when_released, b.tick.stop_when_released);
    EXPECT_EQ(a.stop_line.chip, b.stop_line.chip);
    EXPECT_EQ(a.stop_line.line, b.stop_line.line);
    EXPECT_EQ(a.stop_line.stop_when_high, b.stop_line.stop_when_high);
    EXPECT_EQ(a.tick.period_ns, b.tick.period_ns);
    EXPECT_EQ(a.tick.geometry.name, b.tick.geometry.name);
    EXPECT_EQ(a.tick.geometry.minimum_tension, b.tick.geometry.minimum_tension);
    EXPECT_EQ(a.tick.geometry.maximum_tension, b.tick.geometry.maximum_tension);
    EXPECT_EQ(a.tick.maximum_string_speed, b.tick.maximum_string_speed);
    EXPECT_EQ(a.tick.velocity_window_ticks, b.tick.velocity_window_ticks);
    EXPECT_EQ(a.tick.tension_effort, b.tick.tension_effort);
    EXPECT_EQ(a.tick.tension_infeasible, b.tick.tension_infeasible);
    EXPECT_EQ(a.tick.tension_continuity, b.tick.tension_continuity);
    EXPECT_EQ(a.tick.tension_rate, b.tick.tension_rate);
    EXPECT_EQ(a.tick.frames.stale_after_ns, b.tick.frames.stale_after_ns);
    EXPECT_EQ(a.tick.frames.fade_ns, b.tick.frames.fade_ns);
    EXPECT_EQ(a.tick.frames.ramp_ns, b.tick.frames.ramp_ns);
    EXPECT_EQ(a.tick.limits.force, b.tick.limits.force);
    EXPECT_EQ(a.tick.limits.torque, b.tick.limits.torque);
    EXPECT_EQ(a.tick.limits.force_rate, b.tick.limits.force_rate);
    EXPECT_EQ(a.tick.limits.torque_rate, b.tick.limits.torque_rate);
    EXPECT_EQ(a.tick.passivity.control, b.tick.passivity.control);
    EXPECT_EQ(a.tick.passivity.allowance, b.tick.passivity.allowance);
    EXPECT_EQ(a.tick.passivity.store, b.tick.passivity.store);
    EXPECT_EQ(a.tick.passivity.recovery_s, b.tick.passivity.recovery_s);
    EXPECT_EQ(a.tick.passivity.brake, b.tick.passivity.brake);
    EXPECT_EQ(a.tick.passivity.rotational_brake, b.tick.passivity.rotational_brake);
    EXPECT_EQ(a.tick.passivity.forget_s, b.tick.passivity.forget_s);
    EXPECT_EQ(a.tick.passivity.surface_power, b.tick.passivity.surface_power);
    EXPECT_EQ(a.tick.passivity.damping, b.tick.passivity.damping);
    EXPECT_EQ(a.tick.passivity.rotational_damping, b.tick.passivity.rotational_damping);
    EXPECT_EQ(a.tick.passivity.damping_credit, b.tick.passivity.damping_credit);
    EXPECT_EQ(a.tick.passivity.mass, b.tick.passivity.mass);
    EXPECT_EQ(a.tick.passivity.inertia, b.tick.passivity.inertia);
    EXPECT_EQ(a.tick.passivity.max_damping, b.tick.passivity.max_damping);
    EXPECT_EQ(a.tick.passivity.max_rotational_damping, b.tick.passivity.max_rotational_damping);
    EXPECT_EQ(a.tick.safety.tension_ramp_ns, b.tick.safety.tension_ramp_ns);
    EXPECT_EQ(a.tick.safety.calibration_hold_ns, b.tick.safety.calibration_hold_ns);
    EXPECT_EQ(a.tick.safety.calibration_movement, b.tick.safety.calibration_movement);
    EXPECT_EQ(a.tick.safety.fault_fade_ns, b.tick.safety.fault_fade_ns);
    EXPECT_EQ(a.tick.safety.residual, b.tick.safety.residual);
    EXPECT_EQ(a.tick.safety.residual_share, b.tick.safety.residual_share);
    EXPECT_EQ(a.tick.safety.exchange_share, b.tick.safety.exchange_share);
    EXPECT_EQ(a.tick.safety.late_share, b.tick.safety.late_share);
    EXPECT_EQ(a.tick.safety.window_ns, b.tick.safety.window_ns);
    EXPECT_EQ(a.tick.safety.encoder_age_ns, b.tick.safety.encoder_age_ns);
    EXPECT_EQ(a.tick.motors.continuous_share, b.tick.motors.continuous_share);
    EXPECT_EQ(a.tick.motors.time_constant_s, b.tick.motors.time_constant_s);
    EXPECT_EQ(a.tick.motors.derate_from, b.tick.motors.derate_from);
    EXPECT_EQ(a.tick.black_box_ns, b.tick.black_box_ns);
    EXPECT_EQ(a.usb.id, b.usb.id);
    EXPECT_EQ(a.usb.path, b.usb.path);
    EXPECT_EQ(a.usb.rotary, b.usb.rotary);
    EXPECT_EQ(a.usb.timeout_ns, b.usb.timeout_ns);
}

TEST(Settings, DefaultFileHasTheMechanicsThatAreBuiltIn) {
    Config config = Config::parse(default_config_text(), "default.toml");
    EXPECT_FALSE(read_settings(config).mechanics.has_value());
    config.set("emulated.mechanics=impedance");
    const auto read = read_settings(config).mechanics;
    ASSERT_TRUE(read.has_value());
    const device::GripMechanics built_in;
    EXPECT_EQ(read->hand, built_in.hand);
    EXPECT_EQ(read->mass, built_in.mass);
    EXPECT_EQ(read->inertia, built_in.inertia);
    EXPECT_EQ(read->damping, built_in.damping);
    EXPECT_EQ(read->rotational_damping, built_in.rotational_damping);
    EXPECT_EQ(read->string_stiffness, built_in.string_stiffness);
    EXPECT_EQ(read->string_damping, built_in.string_damping);
    EXPECT_EQ(read->motor_mass, built_in.motor_mass);
    EXPECT_EQ(read->motor_drag, built_in.motor_drag);
    EXPECT_EQ(read->motor_friction, built_in.motor_friction);
    EXPECT_EQ(read->hand_stiffness, built_in.hand_stiffness);
    EXPECT_EQ(read->hand_damping, built_in.hand_damping);
    EXPECT_EQ(read->hand_rotational_stiffness, built_in.hand_rotational_stiffness);
    EXPECT_EQ(read->hand_rotational_damping, built_in.hand_rotational_damping);
}

TEST(Settings, OfTheInstalledFileAreTheBuiltInOnes) {
    const Settings built_in;
    expect_equal(read(std::string(default_config_text())), built_in);
    expect_equal(read(""), built_in);
}

TEST(Settings, LimitTheStiffnessToWhatPeriodAndDampingAllow) {
    const auto limit = [](const std::string& toml) { return read(toml).tick.frames.max_stiffness; };
    EXPECT_DOUBLE_EQ(limit(""), 600.0);  // 2 * 0.3 / 0.001
    EXPECT_DOUBLE_EQ(limit("[loop]\nperiod_s = 0.0005\n"), 1200.0);
    EXPECT_DOUBLE_EQ(limit("[device]\nexchanges = \"one\"\n"), 200.0);
    EXPECT_DOUBLE_EQ(limit("[limits]\nstiffness_delay_s = 0.001\n"), 200.0);
    EXPECT_NEAR(limit("[device]\nfriction = 0.004\n"), 2.0 * 0.004 / 1.66555e-5, 1e-6);
    EXPECT_EQ(limit("[limits]\nstiffness = \"none\"\n"), std::numeric_limits<double>::infinity());
    EXPECT_EQ(limit("[limits]\nstiffness = 250\n"), 250.0);
    EXPECT_THAT([&] { limit("[limits]\nstiffness = \"much\"\n"); },
                ThrowsMessage<ConfigError>(HasSubstr("test.toml:2: limits.stiffness")));
    EXPECT_THAT([&] { limit("[limits]\nstiffness = 0\n"); },
                ThrowsMessage<ConfigError>(HasSubstr("test.toml:2: limits.stiffness")));
}

TEST(Settings, ChooseThePassivityController) {
    EXPECT_EQ(read("").tick.passivity.control, PassivityControl::Bound);
    EXPECT_EQ(read("[passivity]\ncontrol = \"damp\"\n").tick.passivity.control, PassivityControl::Damp);
    EXPECT_EQ(read("[passivity]\ncontrol = \"observe\"\n").tick.passivity.control, PassivityControl::Observe);
    EXPECT_EQ(read("[device]\ndamping = 0.1\n").tick.passivity.damping, 0.1);
}

TEST(Settings, OfTheInstalledFileNameEveryKey) {
    // Each key of the file, set to a value that no key may have, must be refused by name: so it is read.
    const std::string text(default_config_text());
    std::vector<std::string> keys;
    std::string section;
    std::size_t begin = 0;
    while (begin < text.size()) {
        const std::size_t end = text.find('\n', begin);
        const std::string line = text.substr(begin, end - begin);
        begin = end + 1;
        // A key whose default depends on something else is a comment: "# force = 8  # N, ...".
        const std::size_t equals = line.find(" = ");
        const bool note = line.starts_with("# ") && equals != std::string::npos && equals == line.find(' ', 2);
        const std::string assignment = note ? line.substr(2) : line;
        const std::size_t first = assignment.find_first_not_of(' ');
        if (line.starts_with('[')) {
            section = line.substr(1, line.find(']') - 1);
        } else if (line.starts_with("# [")) {
            section.clear();
        } else if (!section.empty() && first != std::string::npos && assignment[first] != '#') {
            const std::string key = section + "." + assignment.substr(0, assignment.find(' '));
            Config config;
            config.set(key + "=[1, 2]");
            EXPECT_THAT([&config] { (void)read_settings(config); }, ThrowsMessage<ConfigError>(HasSubstr(key)));
            EXPECT_THAT(line, HasSubstr("# ")) << "a key without its meaning";
            keys.push_back(key);
        }
    }
    const Config nothing;
    (void)read_settings(nothing);
    keys.emplace_back("profile");  // [[profile]], commented in the file: its tables are counted
    EXPECT_THAT(keys, UnorderedElementsAreArray(nothing.known_keys())) << "the keys that read_settings() reads";
}

TEST(Settings, OfTheInstalledFileLeaveTheProfileToTheDevice) {
    const Config installed = Config::parse(std::string(default_config_text()), "rt-core.toml");
    for (const char* const key : {"safety.profile", "limits.force", "limits.torque_rate"}) {
        EXPECT_FALSE(installed.has(key)) << key << " would be a choice, which neither a device nor a profile changes";
    }
}

TEST(Settings, HaveFormerNamesThatAreStillRead) {
    testing::internal::CaptureStderr();
    EXPECT_EQ(read("[device]\nvariant = \"SpidarG6X5R\"\n").tick.geometry.name, "SpidarG6X5R");
    EXPECT_EQ(read("[passivity]\nlargest_damping = 7.0\n").tick.passivity.max_damping, 7.0);
    EXPECT_EQ(read("[passivity]\nlargest_rotational_damping = 0.5\n").tick.passivity.max_rotational_damping, 0.5);
    EXPECT_THAT(testing::internal::GetCapturedStderr(),
                HasSubstr("test.toml:2: device.variant: is the former name of device.geometry"));
}

TEST(Settings, TakeWhatTheFileSays) {
    const Settings settings = read(
        "[loop]\nperiod_s = 0.0005\npriority = 42\n[frames]\nstale_after_s = 0.25\n[limits]\nforce = 3.5\n"
        "[tension]\ninfeasible = \"direction\"\n"
        "[safety]\nfault_fade_s = 0.2\nexchange_share = 0.4\n[device]\nminimum_tension = 0.5\n");
    EXPECT_EQ(settings.loop.period_ns, 500'000);
    EXPECT_EQ(settings.tick.period_ns, 500'000);
    EXPECT_EQ(settings.loop.priority, 42);
    EXPECT_EQ(settings.tick.frames.stale_after_ns, 250'000'000);
    EXPECT_EQ(settings.tick.limits.force, 3.5);
    EXPECT_EQ(settings.tick.tension_infeasible, Infeasible::Direction);
    EXPECT_EQ(settings.tick.safety.fault_fade_ns, 200'000'000);
    EXPECT_EQ(settings.tick.safety.exchange_share, 0.4);
    EXPECT_EQ(settings.tick.geometry.minimum_tension, 0.5);
}

TEST(Settings, ChooseTheLinesOfTheProbes) {
    EXPECT_FALSE(read("").probes.tick);
    EXPECT_FALSE(read("").probes.frame);
    const ProbeLines lines = read("[probes]\nchip = \"pl061\"\ntick = 5\nframe = \"FRAME\"\nloopback = \"0\"\n").probes;
    EXPECT_EQ(lines.tick->line, "5");
    EXPECT_EQ(lines.frame->line, "FRAME");
    EXPECT_EQ(lines.loopback->line, "0");
    EXPECT_EQ(lines.loopback->chip, "pl061");
    EXPECT_EQ(lines.loopback_edges, EdgeKind::Rising);
    EXPECT_EQ(lines.slowest_edge_ns, 200'000);
    EXPECT_EQ(read("[probes]\nslowest_edge_s = 0.005\n").probes.slowest_edge_ns, 5'000'000);
    EXPECT_EQ(read("[probes]\nloopback_edges = \"both\"\n").probes.loopback_edges, EdgeKind::Both);
    EXPECT_THAT([] { (void)read("[probes]\nchip = \"pl061\"\nloopback = 0\n"); },
                ThrowsMessage<ConfigError>(testing::AllOf(HasSubstr("probes.loopback"), HasSubstr("probes.tick"))));
    EXPECT_THAT([] { (void)read("[probes]\nchip = \"pl061\"\ntick = 5\nframe = 5\n"); },
                ThrowsMessage<ConfigError>(testing::AllOf(HasSubstr("probes.frame"), HasSubstr("probes.tick"))));
}

TEST(Settings, SayWhichUsbDeviceIsMeant) {
    EXPECT_EQ(read("").usb.id, std::nullopt);
    EXPECT_EQ(read("").usb.rotary, std::nullopt);
    const UsbSettings usb =
        read("[device]\nusb_id = \"0cec:0203\"\nusb_path = \"1-2.4\"\nrotary = 7\nusb_timeout_s = 0.001\n").usb;
    EXPECT_EQ(usb.id, (device::UsbId{0x0cec, 0x0203}));
    EXPECT_EQ(usb.path, "1-2.4");
    EXPECT_EQ(usb.rotary, 7);
    EXPECT_EQ(usb.timeout_ns, 1'000'000);
    EXPECT_THAT([] { (void)read("[device]\nusb_id = \"spidar\"\n"); },
                ThrowsMessage<ConfigError>(testing::AllOf(HasSubstr("device.usb_id"), HasSubstr("0cec:0205"))));
}

TEST(Settings, RefuseAnUnknownKeyWithItsLine) {
    EXPECT_THAT([] { (void)read("[loop]\nperiod_s = 0.001\npriorty = 80\n"); },
                ThrowsMessage<ConfigError>(testing::AllOf(HasSubstr("test.toml:3"), HasSubstr("priorty"))));
}

TEST(Settings, LeavePriority98ToTheWatchdogAnd99ToTheKernel) {
    for (const char* priority : {"98", "99"}) {
        EXPECT_THAT([priority] { (void)read(std::string("[loop]\npriority = ") + priority + "\n"); },
                    ThrowsMessage<ConfigError>(HasSubstr("loop.priority")));
    }
    EXPECT_EQ(read("[loop]\npriority = 97\n").watchdog.priority, 98);
}

TEST(Settings, RefuseAWatchdogThatWouldNotWaitForATick) {
    EXPECT_THAT([] { (void)read("[loop]\nperiod_s = 0.02\n[safety]\nwatchdog_s = 0.05\n"); },
                ThrowsMessage<ConfigError>(HasSubstr("safety.watchdog_s")));
}

TEST(Settings, TensionsOnlyNarrowThoseOfTheGeometry) {
    const device::DeviceGeometry own = read("[device]\ngeometry = \"SpidarG6X5R\"\n").tick.geometry;
    EXPECT_EQ(own.name, "SpidarG6X5R");
    EXPECT_EQ(own.minimum_tension, 0.3);
    EXPECT_EQ(own.maximum_tension, 6.0) << "not the 20 N of the default geometry";
    const device::DeviceGeometry narrow =
        read("[device]\ngeometry = \"SpidarG6X5R\"\nminimum_tension = 0.4\nmaximum_tension = 5.0\n").tick.geometry;
    EXPECT_EQ(narrow.minimum_tension, 0.4);
    EXPECT_EQ(narrow.maximum_tension, 5.0);
    const device::DeviceGeometry wide =
        read("[device]\ngeometry = \"SpidarG6X5R\"\nminimum_tension = 0.1\nmaximum_tension = 15.0\n").tick.geometry;
    EXPECT_EQ(wide.minimum_tension, 0.3);
    EXPECT_EQ(wide.maximum_tension, 6.0);
}

TEST(Settings, TakeAGeometryFromAFile) {
    const std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / ("settings-" + std::to_string(getpid()) + ".toml");
    device::DeviceGeometry mine = device::spidar_g6_x3r();
    mine.name = "Mine";
    mine.strings[3].newtons_per_code *= 1.01;
    std::ofstream(file) << device::to_toml(mine, "");
    Config config;
    config.set("device.geometry=" + file.string());
    EXPECT_EQ(read_settings(config).tick.geometry, mine);
    std::filesystem::remove(file);
    EXPECT_THAT([&] { (void)read_settings(config); }, ThrowsMessage<ConfigError>(HasSubstr(file.string())));
}

TEST(Settings, RefuseAnUnknownGeometryAndNameTheBuiltInOnes) {
    EXPECT_THAT([] { (void)read("[device]\ngeometry = \"X9\"\n"); },
                ThrowsMessage<ConfigError>(testing::AllOf(HasSubstr("test.toml:2: device.geometry: no "),
                                                          HasSubstr("SpidarG6X3R"), HasSubstr("SpidarG6T1"))));
}

TEST(Settings, RefuseTensionsThatExcludeEachOther) {
    EXPECT_THAT([] { (void)read("[device]\nminimum_tension = 2.0\nmaximum_tension = 1.5\n"); },
                ThrowsMessage<ConfigError>(HasSubstr("device.maximum_tension")));
    EXPECT_THAT([] { (void)read("[motors]\ncontinuous_share = 0.01\n"); },
                ThrowsMessage<ConfigError>(HasSubstr("motors.continuous_share")));
}

}  // namespace
}  // namespace haptic::rt
