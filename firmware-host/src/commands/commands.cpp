#include "commands/commands.hpp"

#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "boards/sh4_board.hpp"
#include <haptic/device/variant_file.hpp>
#include "geometry/wrench_closure.hpp"

namespace haptic::device {
namespace {

constexpr double kMilli = 1e3;

/// The first bytes of a packet that mean something, 16 to a line.
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

/// What would print as -0.000 because of rounding prints as +0.000.
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

/// m, as a driver works it out from a raw counter that was zero at the centre; the host's count is the negated raw one.
double length_from_counter(const Variant& variant, std::size_t string, std::uint16_t raw) {
    return variant.rest_length(string) -
           static_cast<double>(static_cast<std::int16_t>(raw)) * variant.strings[string].metres_per_count;
}

std::string board_name(const Variant& variant) {
    switch (variant.board) {
        case BoardKind::Sh4:
            return "SH4 board (0cec:0205)";
        case BoardKind::Simple:
            return "Simple board (0cec:0203)";
        case BoardKind::Uart:
            break;
    }
    std::string text = "serial line, boards with";
    for (const int strings : variant.uart_boards) {
        text += " " + std::to_string(strings);
    }
    return text + " strings";
}

/// One cell of the reach: how far the strings go along an axis of force or torque with nothing beside it.
void print_reach(const Variant& variant, std::size_t axis, double sign, double unit) {
    WrenchVector direction{};
    direction[axis] = sign;
    if (const std::optional<double> reach = wrench_reach(variant, {}, direction)) {
        std::printf(" %7.2f", unit * *reach);
    } else {
        std::printf(" %7s", "none");
    }
}

void print_variant(const Variant& variant) {
    std::printf("%s, %s\n", variant.name.c_str(), board_name(variant).c_str());
    std::printf("  tensions %.3g to %.3g N\n\n", variant.minimum_tension, variant.maximum_tension);
    std::printf("%6s | %9s %9s %9s | %9s %9s %9s | %9s %9s %9s\n", "string", "motor x", "y", "z mm", "grip x", "y",
                "z mm", "rest mm", "um/count", "mN/digit");
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringFacts& string = variant.strings[i];
        const Vec3 motor = string.motor * kMilli;
        const Vec3 knot = string.grip * kMilli;
        std::printf("%6zu | %+9.4f %+9.4f %+9.4f | %+9.4f %+9.4f %+9.4f | %9.4f %+9.4f %+9.4f\n", i, motor.x, motor.y,
                    motor.z, knot.x, knot.y, knot.z, kMilli * variant.rest_length(i),
                    kMilli * kMilli * string.metres_per_count, kMilli * string.newtons_per_digit);
    }
    std::printf("\nreach at the centre %7s %7s %7s %7s %7s %7s\n", "+x", "-x", "+y", "-y", "+z", "-z");
    for (const bool torque : {false, true}) {
        std::printf("  %-17s", torque ? "torque, mN*m" : "force, N");
        for (std::size_t axis = torque ? 3 : 0; axis < (torque ? 6U : 3U); ++axis) {
            print_reach(variant, axis, +1.0, torque ? kMilli : 1.0);
            print_reach(variant, axis, -1.0, torque ? kMilli : 1.0);
        }
        std::printf("\n");
    }
    std::printf("  tensions that cancel: the least is %.3f of the largest\n", wrench_closure(variant, {}).evenness);
    for (const VariantWarning& warning : warnings_of(variant)) {
        std::printf("  warning %s: %s\n", warning.name.c_str(), warning.text.c_str());
    }
    std::printf("\n");
}

}  // namespace

bool run_exchange(const Variant& variant, const ExchangeRequest& request) {
    Sh4Command command;
    for (std::size_t i = 0; i < kStrings; ++i) {
        command.digits[i] =
            static_cast<std::uint16_t>(digit_of_tension(request.tensions[i], variant.strings[i].newtons_per_digit));
    }
    Sh4Packet out;
    encode(command, out);

    EmulatedDevice device({.variant = variant, .hand = PoseTrack(request.grip)});
    Sh4Firmware firmware(device);
    Sh4Packet in;
    Sh4Reply reply;
    firmware.receive(out, 0);
    if (decode(std::span<const std::byte>(in).first(firmware.reply(in, 0)), reply) != PacketDefect::None) {
        std::fputs("firmware-host: emulated board: no answer\n", stderr);
        return false;
    }

    const Pose grip = device.grip_pose();
    std::printf("%s on an emulated SH4 board (0cec:0205)\n\n", variant.name.c_str());
    print_vector("position", grip.position * kMilli, 4, "mm");
    std::printf("%-12s %+10.7f %+10.7f %+10.7f %+10.7f  (w, x, y, z)\n\n", "orientation", grip.orientation.w,
                grip.orientation.x, grip.orientation.y, grip.orientation.z);

    std::printf("%24s | IN\n%6s %10s %6s | %6s %8s %6s %13s %11s\n", "OUT", "string", "asked N", "digit", "echo",
                "counter", "A/D", "length mm", "pulls N");
    const std::array<double, kStrings> tensions = device.tensions();
    for (std::size_t i = 0; i < kStrings; ++i) {
        std::printf("%6zu %10.4f %6u | %6u %8u %6u %13.4f %11.4f\n", i, request.tensions[i], command.digits[i],
                    reply.digits[i], reply.counters[i], reply.analog[i],
                    kMilli * length_from_counter(variant, i, reply.counters[i]), tensions[i]);
    }
    std::printf("PIO 0x%04x (switches %u, rotary %u), info 0x%08" PRIx32 "\n\n", reply.pio, reply.pio & 7U,
                (reply.pio >> 4U) & 15U, reply.info);

    const Wrench wrench = device.wrench();
    std::printf("What the strings do to the grip, about its centre, device frame\n");
    print_vector("force", wrench.force, 5, "N");
    print_vector("torque", wrench.torque * kMilli, 4, "mN*m");

    if (request.hex) {
        print_bytes("OUT", out, 18);
        print_bytes("IN", in, 54);
    }
    return true;
}

void run_variants(const std::vector<std::string>& files) {
    std::vector<Variant> variants;
    variants.reserve(files.size());
    for (const std::string& file : files) {
        variants.push_back(load_variant(file));
    }
    if (files.empty()) {
        for (const std::string& name : builtin_variant_names()) {
            variants.push_back(builtin_variant(name));
        }
    }
    for (const Variant& variant : variants) {
        print_variant(variant);
    }
}

}  // namespace haptic::device
