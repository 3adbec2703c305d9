#include "commands/commands.hpp"

#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "codecs/sh4_codec.hpp"
#include "emulated/sh4_firmware.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/wrench_closure.hpp"

namespace haptic::device {
namespace {

/// Prints the used bytes of a packet, 16 per line.
void print_bytes(std::string_view name, const Sh4Packet& packet, std::size_t used) {
    std::printf("\n%.*s, first %zu of %zu bytes\n", static_cast<int>(name.size()), name.data(), used, packet.size());
    for (std::size_t i = 0; i < used; ++i) {
        const bool starts = i % 16 == 0;
        const bool ends = i % 16 == 15 || i + 1 == used;
        if (starts) {
            std::printf("  %3zu ", i);
        }
        std::printf(" %02x%s", std::to_integer<unsigned>(packet[i]), ends ? "\n" : "");
    }
}

/// Avoids -0.000 as the result of rounding.
double without_sign_of_zero(double value, int decimals) {
    return std::abs(value) < 0.5 * std::pow(10.0, -decimals) ? 0.0 : value;
}

void print_vector(const char* name, const Vec3& v, int decimals, const char* unit) {
    std::printf("%-12s", name);
    for (const double value : {v.x, v.y, v.z}) {
        std::printf(" %+10.*f", decimals, without_sign_of_zero(value, decimals));
    }
    std::printf("  %s\n", unit);
}

/// String length, m, from a raw counter that is zero at the centre. The host's count is the negated raw counter.
double length_from_counter(const DeviceGeometry& geometry, std::size_t string, std::uint16_t raw) {
    return geometry.rest_length(string) -
           static_cast<double>(static_cast<std::int16_t>(raw)) * geometry.strings[string].metres_per_count;
}

std::string board_name(const DeviceGeometry& geometry) {
    switch (geometry.board) {
        case BoardKind::Sh4:
            return "SH4 board (0cec:0205)";
        case BoardKind::Simple:
            return "Simple board (0cec:0203)";
        case BoardKind::Uart:
            break;
    }
    std::string text = "serial line, boards with";
    for (const int strings : geometry.uart_boards) {
        text += " " + std::to_string(strings);
    }
    return text + " strings";
}

/// One cell of the reach table: the largest pure force or torque along an axis.
void print_reach(const DeviceGeometry& geometry, std::size_t axis, double sign, double unit) {
    WrenchVector direction{};
    direction[axis] = sign;
    if (const std::optional<double> reach = wrench_reach(geometry, {}, direction)) {
        std::printf(" %7.2f", unit * *reach);
    } else {
        std::printf(" %7s", "none");
    }
}

void print_geometry(const DeviceGeometry& geometry) {
    std::printf("%s, %s\n", geometry.name.c_str(), board_name(geometry).c_str());
    std::printf("  tensions %.3g to %.3g N\n\n", geometry.minimum_tension, geometry.maximum_tension);
    std::printf("%6s | %9s %9s %9s | %9s %9s %9s | %9s %9s %9s\n", "string", "motor x", "y", "z mm", "grip x", "y",
                "z mm", "rest mm", "um/count", "mN/code");
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringFacts& string = geometry.strings[i];
        const Vec3 motor = string.motor * kMilli;
        const Vec3 knot = string.grip * kMilli;
        std::printf("%6zu | %+9.4f %+9.4f %+9.4f | %+9.4f %+9.4f %+9.4f | %9.4f %+9.4f %+9.4f\n", i, motor.x, motor.y,
                    motor.z, knot.x, knot.y, knot.z, kMilli * geometry.rest_length(i),
                    kMilli * kMilli * string.metres_per_count, kMilli * string.newtons_per_code);
    }
    // Reach: pure forces and torques in both directions.
    std::printf("\nreach at the centre %7s %7s %7s %7s %7s %7s\n", "+x", "-x", "+y", "-y", "+z", "-z");
    for (const bool torque : {false, true}) {
        std::printf("  %-17s", torque ? "torque, mN*m" : "force, N");
        for (std::size_t axis = torque ? 3 : 0; axis < (torque ? 6U : 3U); ++axis) {
            print_reach(geometry, axis, +1.0, torque ? kMilli : 1.0);
            print_reach(geometry, axis, -1.0, torque ? kMilli : 1.0);
        }
        std::printf("\n");
    }
    std::printf("  tension factor %.3f (smallest / largest of tensions that cancel)\n",
                wrench_closure(geometry, {}).tension_factor);
    for (const DeviceGeometryWarning& warning : warnings_of(geometry)) {
        std::printf("  warning %s: %s\n", warning.name.c_str(), warning.text.c_str());
    }
    std::printf("\n");
}

}  // namespace

bool run_exchange(const DeviceGeometry& geometry, const ExchangeRequest& request) {
    // OUT packet.
    Sh4Command command;
    for (std::size_t i = 0; i < kStrings; ++i) {
        command.dac_codes[i] =
            static_cast<std::uint16_t>(dac_code_of_tension(request.tensions[i], geometry.strings[i].newtons_per_code));
    }
    Sh4Packet out;
    encode(command, out);

    // One exchange with an emulated board.
    EmulatedDevice device({.geometry = geometry, .hand = PoseTrack(request.grip)});
    Sh4Firmware firmware(device);
    Sh4Packet in;
    Sh4Reply reply;
    firmware.receive(out, 0);
    if (decode(std::span<const std::byte>(in).first(firmware.reply(in, 0)), reply) != PacketDefect::None) {
        std::fputs("firmware-host: emulated board: no reply\n", stderr);
        return false;
    }

    // Pose, one row per string, wrench.
    const Pose grip = device.grip_pose();
    std::printf("%s on an emulated SH4 board (0cec:0205)\n\n", geometry.name.c_str());
    print_vector("position", grip.position * kMilli, 4, "mm");
    std::printf("%-12s %+10.7f %+10.7f %+10.7f %+10.7f  (w, x, y, z)\n\n", "orientation", grip.orientation.w,
                grip.orientation.x, grip.orientation.y, grip.orientation.z);

    std::printf("%24s | IN\n%6s %10s %6s | %6s %8s %6s %13s %11s\n", "OUT", "string", "asked N", "code", "echo",
                "counter", "A/D", "length mm", "pulls N");
    const std::array<double, kStrings> tensions = device.tensions();
    for (std::size_t i = 0; i < kStrings; ++i) {
        std::printf("%6zu %10.4f %6u | %6u %8u %6u %13.4f %11.4f\n", i, request.tensions[i], command.dac_codes[i],
                    reply.dac_codes[i], reply.counters[i], reply.analog[i],
                    kMilli * length_from_counter(geometry, i, reply.counters[i]), tensions[i]);
    }
    std::printf("PIO 0x%04x (switches %u, rotary %u), info 0x%08" PRIx32 "\n\n", reply.pio, reply.pio & 7U,
                (reply.pio >> 4U) & 15U, reply.info);

    const Wrench wrench = device.wrench();
    std::printf("Wrench of the strings on the grip, about its centre, device frame\n");
    print_vector("force", wrench.force, 5, "N");
    print_vector("torque", wrench.torque * kMilli, 4, "mN*m");

    if (request.hex) {
        print_bytes("OUT", out, 18);
        print_bytes("IN", in, 54);
    }
    return true;
}

void run_geometries(const std::vector<std::string>& files) {
    std::vector<DeviceGeometry> geometries;
    geometries.reserve(files.size());
    for (const std::string& file : files) {
        geometries.push_back(load_device_geometry(file));
    }
    if (files.empty()) {
        for (const std::string& name : built_in_geometry_names()) {
            geometries.push_back(built_in_geometry(name));
        }
    }
    for (const DeviceGeometry& geometry : geometries) {
        print_geometry(geometry);
    }
}

}  // namespace haptic::device
