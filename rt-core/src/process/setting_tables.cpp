#include "process/setting_tables.hpp"

namespace haptic::rt {
namespace {

constexpr Range kFadeTimes{0.001, 10.0};  // s
constexpr Range kShares{0.0, 1.0};
constexpr Range kEnergies{0.0, 1.0};          // J
constexpr Range kExchangeTimes{0.0002, 0.1};  // s

/// A probe's line, by name or offset: key probes.NAME.
SettingValue<ProbeLines> probe_line(std::optional<GpioLine> ProbeLines::* member, const char* name) {
    return SettingValues<ProbeLines>::parsed(
        member, {"text or integer", Range{0, 1023}}, "\"\"",
        [name](const Config& config, const std::string&) { return read_probe_line(config, name, "rt-core"); });
}

}  // namespace

const SettingTable<LoopSettings>& loop_table() {
    using S = LoopSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "loop",
        "The real-time loop.",
        {
            {{.key = "period_s", .unit = "s", .meaning = "Time between ticks; 0.001 is 1 kHz."},
             V::duration(&S::period_ns, {0.0001, 0.02})},
            {{.key = "priority",
              .meaning =
                  "SCHED_FIFO priority of the loop. The watchdog gets the next higher one, the thread of contact "
                  "frames the next lower; 99 is used by kernel threads."},
             V::integer(&S::priority, {1, 97})},
            {{.key = "cpu",
              .meaning =
                  "CPU that the loop is pinned to. -1: the last isolated CPU, or the last allowed one if none is "
                  "isolated."},
             V::integer(&S::cpu, {-1, 1023})},
            {{.key = "idle_exit_us",
              .unit = "us",
              .meaning = "Longest wake-up latency of idle states that the kernel may use while the loop runs "
                         "(/dev/cpu_dma_latency). -1: no request."},
             V::integer(&S::idle_exit_us, {-1, 100'000})},
            {{.key = "warm_up_ticks", .meaning = "Disarmed ticks before measuring starts."},
             V::integer(&S::warm_up_ticks, {1, 100'000})},
        }};
    return table;
}

const SettingTable<FileKeys>& geometry_table() {
    using S = FileKeys;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "device",
        "The device and its connection.",
        {
            {{.key = "geometry",
              .old_key = "device.variant",
              .meaning = "Device geometry: a built-in name (listed by firmware-host geometries) or the path of a "
                         "geometry file (*.toml)."},
             V::text(&S::geometry)},
            {{.key = "protocol",
              .meaning = "Signed protocol of rt-core bringup for this device. Empty: F.protocol.json beside the "
                         "geometry file F.toml. Without one, a real device renders at most 1 N."},
             V::text(&S::protocol)},
            {{.key = "minimum_tension",
              .unit = "N",
              .meaning = "Minimum tension of every string. A larger minimum of the geometry has precedence."},
             V::number(&S::minimum_tension, {0.0, 5.0})},
            {{.key = "maximum_tension",
              .unit = "N",
              .meaning = "Maximum tension of every string. A smaller maximum of the geometry has precedence."},
             V::number(&S::maximum_tension, {0.1, 200.0})},
        }};
    return table;
}

const SettingTable<TickSettings>& exchange_table() {
    using S = TickSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "device",
        "",
        {
            {{.key = "exchanges",
              .meaning = "Exchanges with the board per tick. With two, the force of a tick is sent in the same tick; "
                         "with one, in the next."},
             V::choice(&S::exchanges, {{"one", 1}, {"two", 2}})},
            {{.key = "maximum_string_speed",
              .unit = "m/s",
              .meaning = "A string that moves faster is treated as an encoder fault."},
             V::number(&S::maximum_string_speed, {0.1, 20.0})},
        }};
    return table;
}

const SettingTable<FileKeys>& usb_choice_table() {
    using S = FileKeys;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "device",
        "",
        {
            {{.key = "usb_id",
              .meaning = "USB vendor and product in hexadecimal, such as 0cec:0205. Empty: those of the geometry's "
                         "board."},
             V::text(&S::usb_id)},
            {{.key = "rotary", .meaning = "Position of the board's rotary switch. -1: any."},
             V::integer(&S::rotary, {-1, 15})},
        }};
    return table;
}

const SettingTable<UsbSettings>& usb_table() {
    using S = UsbSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "device",
        "",
        {
            {{.key = "usb_path",
              .meaning = "USB port, such as 1-2.4, or device node, such as /dev/bus/usb/001/007. Empty: any."},
             V::text(&S::path)},
            {{.key = "usb_timeout_s",
              .unit = "s",
              .meaning = "Maximum duration of a command and its answer over USB. A tick waits at most 4 times as long, "
                         "or twice with device.exchanges = \"one\"."},
             V::duration(&S::timeout_ns, kExchangeTimes)},
        }};
    return table;
}

const SettingTable<device::BoardOptions>& board_table() {
    using S = device::BoardOptions;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "device",
        "",
        {
            {{.key = "echo",
              .meaning = "SH4 boards: whether an answer must repeat the DAC codes of the command that was just sent."},
             V::choice(&S::check_echo, {{"check", true}, {"ignore", false}})},
            {{.key = "simple_phase", .meaning = "Simple boards: bit i is the counting direction of encoder i."},
             V::integer(&S::simple_phase, {0, 255})},
            {{.key = "uart_padding",
              .meaning = "UART boards: zero bytes sent after a command, in addition to those that clock its answer "
                         "out."},
             V::integer([](S& s) -> auto& { return s.uart.padding; }, {0, 200})},
            {{.key = "uart_set_lengths",
              .meaning = "UART boards: whether each board is told the lengths of the commands to the other boards on "
                         "its line."},
             V::choice([](S& s) -> auto& { return s.uart.set_lengths; }, {{"yes", true}, {"no", false}})},
        }};
    return table;
}

const SettingTable<device::TtyBoard::Settings>& serial_table() {
    using S = device::TtyBoard::Settings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "device",
        "",
        {
            {{.key = "uart_baud", .unit = "bit/s", .meaning = "Speed of the serial line to UART boards."},
             V::integer(&S::baud, {115'200, 3'000'000})},
            {{.key = "uart_timeout_s",
              .unit = "s",
              .meaning = "Maximum duration of a command and its answer over the serial line. A tick waits at most 4 "
                         "times as long, or twice with device.exchanges = \"one\"."},
             V::duration(&S::timeout_ns, kExchangeTimes)},
        }};
    return table;
}

const SettingTable<PassivitySettings>& mechanics_table() {
    using S = PassivitySettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "device",
        "The defaults of damping, rotational_damping, mass and inertia are those of the emulated grip: no published "
        "source gives them for a real device. Measure them, or set both dampings to 0.",
        {
            {{.key = "damping",
              .unit = "N*s/m",
              .meaning = "Lower bound of the viscous damping of the grip's translation."},
             V::number(&S::damping, {0.0, 100.0})},
            {{.key = "rotational_damping",
              .unit = "N*m*s/rad",
              .meaning = "Lower bound of the viscous damping of the grip's rotation."},
             V::number(&S::rotational_damping, {0.0, 0.1})},
            {{.key = "mass",
              .unit = "kg",
              .meaning = "Mass of the grip without a hand, the smallest mass that the wrench moves."},
             V::number(&S::mass, {0.001, 10.0})},
            {{.key = "inertia",
              .unit = "kg*m^2",
              .meaning = "Moment of inertia of the grip without a hand, the smallest that the torque moves."},
             V::number(&S::inertia, {1e-7, 0.1})},
        }};
    return table;
}

const SettingTable<FileKeys>& friction_table() {
    using S = FileKeys;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "device",
        "",
        {{{.key = "friction", .unit = "N", .meaning = "Coulomb friction of the grip. 0: unknown."},
          V::number(&S::friction, {0.0, 10.0})}}};
    return table;
}

const SettingTable<TickSettings>& velocity_table() {
    using S = TickSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "velocity",
        "",
        {{{.key = "window_ticks",
           .meaning =
               "Longest window of the velocity estimate. The window becomes shorter by itself while the velocity "
               "changes."},
          V::integer(&S::velocity_window_ticks, {1, AdaptiveVelocity::kMaxTicks})}}};
    return table;
}

const SettingTable<FrameSettings>& frames_table() {
    using S = FrameSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "frames",
        "Contact frames from the simulation.",
        {
            {{.key = "stale_after_s",
              .unit = "s",
              .meaning = "A frame that is older than this, and older than 3 of its steps, is stale: its force fades."},
             V::duration(&S::stale_after_ns, kFadeTimes)},
            {{.key = "fade_s", .unit = "s", .meaning = "Time in which the force of a stale frame fades to zero."},
             V::duration(&S::fade_ns, kFadeTimes)},
            {{.key = "ramp_s", .unit = "s", .meaning = "Time in which the force of a new source is faded in."},
             V::duration(&S::ramp_ns, kFadeTimes)},
        }};
    return table;
}

const SettingTable<OverlaySettings>& overlay_table() {
    using S = OverlaySettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "overlay",
        "A wrench that a node of ROS 2 adds beside the contact, through rt-core relay --ros-overlay. "
        "All limits hold for the sum.",
        {
            {{.key = "max_force", .unit = "N", .meaning = "Maximum force of the overlay. 0: none is taken."},
             V::number(&S::max_force, {0.0, 5.0})},
            {{.key = "max_torque", .unit = "N*m", .meaning = "Maximum torque of the overlay. 0: none is taken."},
             V::number(&S::max_torque, {0.0, 0.1})},
            {{.key = "timeout_s",
              .unit = "s",
              .meaning = "Time since an overlay arrived on this machine after which it fades."},
             V::duration(&S::timeout_ns, {0.005, 1.0})},
            {{.key = "ramp_s",
              .unit = "s",
              .meaning = "Time in which an overlay rises from zero to its maximum, or fades from it to zero; bounds "
                         "its rate."},
             V::duration(&S::ramp_ns, {0.01, 10.0})},
        }};
    return table;
}

const SettingTable<WrenchLimits>& limits_table() {
    using S = WrenchLimits;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "limits",
        "Limits of the rendered wrench.",
        {
            {{.key = "force", .unit = "N", .default_note = "that of the profile, or 8", .meaning = "Maximum force."},
             V::number(&S::force, {0.0, 60.0})},
            {{.key = "torque",
              .unit = "N*m",
              .default_note = "that of the profile, or 0.15",
              .meaning = "Maximum torque."},
             V::number(&S::torque, {0.0, 1.0})},
            {{.key = "force_rate",
              .unit = "N/s",
              .default_note = "that of the profile, or 1000",
              .meaning = "Maximum rate of change of the force. 1000 N/s let 2000 N/m be met at 0.5 m/s without "
                         "blunting the contact."},
             V::number(&S::force_rate, {1.0, 1e6})},
            {{.key = "torque_rate",
              .unit = "N*m/s",
              .default_note = "that of the profile, or 20",
              .meaning = "Maximum rate of change of the torque."},
             V::number(&S::torque_rate, {0.01, 1e5})},
        }};
    return table;
}

const SettingTable<FileKeys>& stiffness_table() {
    using S = FileKeys;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "limits",
        "",
        {
            {{.key = "stiffness",
              .unit = "N/m",
              .meaning = "Maximum stiffness of a contact frame. \"auto\": the passive one, min(2 device.damping / "
                         "(loop.period_s + 2 delay), 2 device.friction / encoder count); \"none\": no limit."},
             V::number_or_word(&S::stiffness, {1.0, 1e6}, {"auto", "none"})},
            {{.key = "rotational_stiffness",
              .unit = "N*m/rad",
              .meaning = "Maximum rotational stiffness that the proxies of a tool may make together. \"auto\": 2 "
                         "device.rotational_damping / (loop.period_s + 2 delay); \"none\": no limit."},
             V::number_or_word(&S::rotational_stiffness, {1e-3, 1e3}, {"auto", "none"})},
            {{.key = "stiffness_delay_s",
              .unit = "s",
              .meaning = "Delay of the force that \"auto\" allows for, in addition to the period that "
                         "device.exchanges = \"one\" costs."},
             V::number(&S::stiffness_delay_s, {0.0, 1.0})},
        }};
    return table;
}

const SettingTable<PassivitySettings>& passivity_table() {
    using S = PassivitySettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "passivity",
        "The passivity controller.",
        {
            {{.key = "control",
              .meaning =
                  "\"bound\": scales the wrench so that the contact cannot give out more energy than it took in; "
                  "\"damp\": adds damping that dissipates the excess; \"observe\": only measures."},
             V::choice(&S::control, {{"bound", PassivityControl::Bound},
                                     {"damp", PassivityControl::Damp},
                                     {"observe", PassivityControl::Observe}})},
            {{.key = "allowance",
              .unit = "J",
              .meaning = "Energy that a contact may give to the hand beyond what it took in."},
             V::number(&S::allowance, kEnergies)},
            {{.key = "store",
              .unit = "J",
              .meaning = "Upper bound of the energy that is credited beyond that of the coupling's springs."},
             V::number(&S::store, kEnergies)},
            {{.key = "damping_credit",
              .meaning = "Fraction of the device's damping that a contact may use up. The rest makes vibration decay."},
             V::number(&S::damping_credit, {0.0, 1.0})},
            {{.key = "recovery_s", .unit = "s", .meaning = "Time constant with which a bounded wrench recovers."},
             V::number(&S::recovery_s, {0.0, 1.0})},
            {{.key = "brake",
              .unit = "N*s/m",
              .meaning = "Damping that \"bound\" applies when nothing is left of the wrench. Stable far below "
                         "device.mass / loop.period_s."},
             V::number(&S::brake, {0.0, 1000.0})},
            {{.key = "rotational_brake",
              .unit = "N*m*s/rad",
              .meaning = "The same for rotation. Stable far below device.inertia / loop.period_s."},
             V::number(&S::rotational_brake, {0.0, 1.0})},
            {{.key = "forget_s",
              .unit = "s",
              .meaning = "Time constant with which an energy deficit is forgotten in free motion."},
             V::number(&S::forget_s, {0.01, 1000.0})},
            {{.key = "surface_power",
              .unit = "W",
              .meaning =
                  "Maximum power that moving surfaces may bring in, by the work that contact frames report or the "
                  "velocities that they announce. 0: none."},
             V::number(&S::surface_power, {0.0, 1000.0})},
            {{.key = "max_damping",
              .unit = "N*s/m",
              .old_key = "passivity.largest_damping",
              .meaning = "Maximum damping of \"damp\". Stable below device.mass / loop.period_s."},
             V::number(&S::max_damping, {0.0, 1000.0})},
            {{.key = "max_rotational_damping",
              .unit = "N*m*s/rad",
              .old_key = "passivity.largest_rotational_damping",
              .meaning = "Maximum rotational damping of \"damp\"."},
             V::number(&S::max_rotational_damping, {0.0, 1.0})},
        }};
    return table;
}

const SettingTable<TickSettings>& tension_table() {
    using S = TickSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "tension",
        "Distribution of the wrench over the strings.",
        {
            {{.key = "infeasible",
              .meaning = "Result for a wrench that no tensions can produce: the \"closest\" one, or the largest one in "
                         "the same \"direction\"."},
             V::choice(&S::tension_infeasible,
                       {{"closest", Infeasible::Closest}, {"direction", Infeasible::Direction}})},
            {{.key = "effort", .meaning = "Weight of small tensions against the error of the wrench."},
             V::number(&S::tension_effort, {1e-12, 1.0})},
            {{.key = "continuity", .meaning = "Weight of small changes of tension."},
             V::number(&S::tension_continuity, {0.0, 1.0})},
            {{.key = "rate",
              .unit = "N/s",
              .meaning = "Maximum rate of change of one tension. The default exceeds what the rate limits of the "
                         "wrench can cause."},
             V::number(&S::tension_rate, {10.0, 1e6})},
        }};
    return table;
}

const SettingTable<MotorSettings>& motors_table() {
    using S = MotorSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "motors",
        "Thermal model. A geometry file may give continuous_share and time_constant_s for each motor.",
        {
            {{.key = "continuous_share",
              .meaning = "Fraction of the maximum tension that a motor can hold continuously."},
             V::number(&S::continuous_share, {0.01, 1.0})},
            {{.key = "time_constant_s", .unit = "s", .meaning = "Time constant with which a motor heats up."},
             V::number(&S::time_constant_s, {0.1, 10'000.0})},
            {{.key = "derate_from",
              .meaning = "Thermal load, 1 being the limit, above which the maximum tension of a motor is reduced."},
             V::number(&S::derate_from, {0.0, 0.99})},
        }};
    return table;
}

const SettingTable<SafetySettings>& safety_table() {
    using S = SafetySettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "safety",
        "",
        {
            {{.key = "tension_ramp_s",
              .unit = "s",
              .meaning = "Time in which the tension rises from zero to the minimum, and falls back."},
             V::duration(&S::tension_ramp_ns, {0.01, 10.0})},
            {{.key = "calibration_hold_s",
              .unit = "s",
              .meaning = "Time for which the grip must be held still at the centre."},
             V::duration(&S::calibration_hold_ns, {0.0, 60.0})},
            {{.key = "calibration_movement",
              .unit = "m",
              .meaning = "Change of string length up to which the grip counts as still."},
             V::number(&S::calibration_movement, {0.00005, 0.01})},
            {{.key = "fault_fade_s",
              .unit = "s",
              .meaning = "Time in which the wrench fades to zero after a fault or a stop."},
             V::duration(&S::fault_fade_ns, {0.001, 10.0})},
            {{.key = "residual",
              .unit = "m",
              .meaning = "Maximum root mean square residual of the string lengths. One string that reads 7 mm wrong "
                         "reaches the default."},
             V::number(&S::residual, {0.0001, 0.1})},
            {{.key = "window_s",
              .unit = "s",
              .meaning = "Recent time by whose share lost exchanges and contradicting lengths are judged: the time "
                         "constant of a leaky bucket."},
             V::duration(&S::window_ns, {0.01, 10.0})},
            {{.key = "late_window_s",
              .unit = "s",
              .meaning = "Recent time by whose share lateness is judged. With the emulated device at least 2 s."},
             V::duration(&S::late_window_ns, {0.01, 100.0})},
            {{.key = "residual_share",
              .meaning = "Share of recent time with a larger residual that is tolerated; more is a fault."},
             V::number(&S::residual_share, kShares)},
            {{.key = "exchange_share",
              .meaning = "Share of recent time without an answer from the board that is tolerated; more is a fault."},
             V::number(&S::exchange_share, kShares)},
            {{.key = "late_share",
              .meaning = "Share of recent time after missed deadlines that is tolerated; more is a fault."},
             V::number(&S::late_share, kShares)},
            {{.key = "encoder_age_s",
              .unit = "s",
              .meaning = "Age of the newest encoder counters up to which the loop acts on them; older is a fault."},
             V::duration(&S::encoder_age_ns, {0.002, 10.0})},
        }};
    return table;
}

const SettingTable<Settings>& recovery_table() {
    using S = Settings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "safety",
        "",
        {
            {{.key = "watchdog_s",
              .unit = "s",
              .meaning = "Time without a finished tick after which the watchdog sends zeros to the motors. At least 5 "
                         "times loop.period_s. With the emulated device at least 2 s."},
             V::duration([](S& s) -> auto& { return s.watchdog.limit_ns; }, {0.01, 10.0})},
            {{.key = "guard_s",
              .unit = "s",
              .meaning =
                  "Time without a beginning or ending tick after which the guard process takes the loop for frozen "
                  "and sends zeros to the motors. At least what a tick may wait for its board, plus 4 times "
                  "loop.period_s; a smaller value counts as that. Not with the emulated device."},
             V::duration([](S& s) -> auto& { return s.guard.silence_ns; }, {0.003, 10.0})},
            {{.key = "prove",
              .meaning =
                  "Whether the device must prove its wiring when it is armed, and its pose by movement before it "
                  "renders more than a trace: \"auto\" for a real device, \"always\" or \"never\". The ideal "
                  "emulated grip does not yield and can prove nothing."},
             V::choice(&S::prove, {{"auto", Prove::RealDevice}, {"always", Prove::Always}, {"never", Prove::Never}})},
            {{.key = "arm",
              .meaning = "What arms the device for the first time: the \"start\" of the program, or a \"person\" by "
                         "key, button or rt-core arm. After the device was lost it is always a person."},
             V::choice(&S::person_arms, {{"start", false}, {"person", true}})},
            {{.key = "arm_button",
              .meaning = "Switch of the board by which a person arms, held for 1 s after it was released. -1: none."},
             V::integer([](S& s) -> auto& { return s.loop.arm_button; }, {-1, 2})},
            {{.key = "profile",
              .default_note = "normal for a real device, none for an emulated one",
              .meaning = "Profile of forces: learning, normal, expert, or the name of a table [[profile]]."},
             V::text(&S::profile)},
            {{.key = "walls",
              .meaning = "Whether the profile's soft walls keep the grip in the reachable workspace. rt-core calibrate "
                         "turns them off."},
             V::flag(&S::walls)},
            {{.key = "reconnect",
              .old_key = "safety.rearm",
              .meaning = "Whether to wait for a lost device, and then for a person to arm it, instead of ending."},
             V::flag(&S::reconnect)},
        }};
    return table;
}

const SettingTable<TickSettings>& stop_button_table() {
    using S = TickSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "safety",
        "",
        {
            {{.key = "stop_button", .meaning = "Switch of the board that stops the loop. -1: none."},
             V::integer(&S::stop_button, {-1, 2})},
            {{.key = "stop_button_when",
              .meaning = "State of the switch that means stop. With \"released\" a broken wire stops the loop too."},
             V::choice(&S::stop_when_released, {{"held", false}, {"released", true}})},
        }};
    return table;
}

const SettingTable<GpioStopSettings>& stop_line_table() {
    using S = GpioStopSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "safety",
        "",
        {
            {{.key = "stop_chip", .meaning = "GPIO chip of a stop line: label, name or path. Empty: no stop line."},
             V::text(&S::chip)},
            {{.key = "stop_line", .meaning = "Offset of the stop line in its chip."}, V::integer(&S::line, {0, 1023})},
            {{.key = "stop_level",
              .meaning = "Level that means stop. The line is biased to it, so that a broken wire stops the loop."},
             V::choice(&S::stop_when_high, {{"high", true}, {"low", false}})},
        }};
    return table;
}

const SettingTable<FileKeys>& relay_table() {
    using S = FileKeys;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "safety",
        "",
        {
            {{.key = "relay_chip",
              .meaning =
                  "GPIO chip of the line that keeps the motors' relay closed: label, name or path. Empty: none."},
             V::text(&S::relay_chip)},
            {{.key = "relay_line",
              .meaning = "Offset of that line in its chip. It toggles with each tick while the loop is armed and its "
                         "board answers, and is steady otherwise: a square wave of half the loop's rate."},
             V::integer(&S::relay_line, {0, 1023})},
        }};
    return table;
}

const SettingTable<ProbeLines>& probe_lines_table() {
    using S = ProbeLines;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "probes",
        "A line is a name (\"GPIO17\") or an offset (5). Empty: none.",
        {
            {{.key = "tick", .meaning = "Line that is high while a tick runs."}, probe_line(&S::tick, "tick")},
            {{.key = "frame", .meaning = "Line that toggles with each contact frame that the loop takes."},
             probe_line(&S::frame, "frame")},
            {{.key = "loopback",
              .meaning = "Line that is wired to the tick's line; rt-core measure records its edges."},
             probe_line(&S::loopback, "loopback")},
            {{.key = "loopback_edges",
              .meaning = "Edges to record. \"both\" also measures how long the line is high; it needs interrupt "
                         "threads that are faster than a tick."},
             V::choice(&S::loopback_edges, {{"rising", EdgeKind::Rising}, {"both", EdgeKind::Both}})},
        }};
    return table;
}

const SettingTable<Settings>& recording_table() {
    using S = Settings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "recording",
        "",
        {
            {{.key = "queue_ticks",
              .meaning = "Ticks that may wait for the writing thread. Ticks beyond that are dropped and counted."},
             V::integer(&S::queue_ticks, {16, 1'048'576})},
            {{.key = "queue_frames", .meaning = "Contact frames, 89 kB each, that may wait for the writing thread."},
             V::integer(&S::queue_frames, {16, 8192})},
            {{.key = "black_box_s",
              .unit = "s",
              .meaning = "Time before a fault for which all ticks are kept. At least loop.period_s."},
             V::duration([](S& s) -> auto& { return s.tick.black_box_ns; }, {0.01, 60.0})},
        }};
    return table;
}

}  // namespace haptic::rt
