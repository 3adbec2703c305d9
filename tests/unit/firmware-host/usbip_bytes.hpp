// Hand-written USB/IP messages for tests: big-endian words, and the client's side of the protocol.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string_view>
#include <vector>

namespace haptic::test {

using Bytes = std::vector<std::byte>;

/// "01 0e 2d": spaces and line ends are ignored.
inline Bytes hex(std::string_view text) {
    Bytes bytes;
    unsigned value = 0;
    int dac_codes = 0;
    for (const char c : text) {
        if (c == ' ' || c == '\n') {
            continue;
        }
        value = value * 16U + static_cast<unsigned>(c <= '9' ? c - '0' : c - 'a' + 10);
        if (++dac_codes == 2) {
            bytes.push_back(static_cast<std::byte>(value));
            value = 0;
            dac_codes = 0;
        }
    }
    return bytes;
}

inline Bytes zeros(std::size_t count) {
    return Bytes(count, std::byte{0});
}

inline Bytes joined(std::initializer_list<Bytes> parts) {
    Bytes all;
    for (const Bytes& part : parts) {
        all.insert(all.end(), part.begin(), part.end());
    }
    return all;
}

inline Bytes words(std::initializer_list<std::uint32_t> values) {
    Bytes bytes;
    for (const std::uint32_t value : values) {
        for (const unsigned shift : {24U, 16U, 8U, 0U}) {
            bytes.push_back(static_cast<std::byte>((value >> shift) & 0xFFU));
        }
    }
    return bytes;
}

inline std::uint32_t word_at(std::span<const std::byte> bytes, std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        value = value * 256U + std::to_integer<std::uint32_t>(bytes[at + i]);
    }
    return value;
}

inline constexpr std::uint32_t kDevice = 0x00010002;  // bus 1, address 2

/// OP_REQ_IMPORT.
inline Bytes import_request(std::string_view bus_id = "1-1") {
    Bytes request = joined({hex("0111 8003 00000000"), zeros(32)});
    for (std::size_t i = 0; i < bus_id.size() && i < 32; ++i) {
        request[8 + i] = static_cast<std::byte>(bus_id[i]);
    }
    return request;
}

/// USBIP_CMD_SUBMIT of an IN transfer.
inline Bytes submit_in(std::uint32_t sequence, std::uint32_t endpoint, std::uint32_t length, std::uint32_t flags = 0,
                       const Bytes& setup = zeros(8)) {
    return joined({words({1, sequence, kDevice, 1, endpoint, flags, length, 0, 0, 0}), setup});
}

/// USBIP_CMD_SUBMIT of an OUT transfer with its data.
inline Bytes submit_out(std::uint32_t sequence, std::uint32_t endpoint, const Bytes& data, std::uint32_t flags = 0,
                        const Bytes& setup = zeros(8)) {
    return joined({words({1, sequence, kDevice, 0, endpoint, flags, static_cast<std::uint32_t>(data.size()), 0, 0, 0}),
                   setup, data});
}

/// USBIP_CMD_UNLINK.
inline Bytes unlink(std::uint32_t sequence, std::uint32_t target) {
    return joined({words({2, sequence, kDevice, 0, 0, target}), zeros(24)});
}

}  // namespace haptic::test
