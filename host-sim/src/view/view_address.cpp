// Parses the address given to --view, and warns when it is reachable from other machines.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <charconv>
#include <stdexcept>

#include "view/live_view.hpp"

namespace haptic::sim::view {
namespace {

/// Throws an error that quotes the argument and shows the accepted forms.
[[noreturn]] void refuse(const std::string& text, const std::string& why) {
    throw std::invalid_argument("--view " + text + ": " + why +
                                "; give ADDR:PORT or PORT, e.g. 127.0.0.1:7060, or [::1]:7060");
}

std::uint16_t port_of(const std::string& text, std::string_view digits) {
    std::uint16_t port = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
    if (digits.empty() || error != std::errc() || end != digits.data() + digits.size()) {
        refuse(text, "the port must be an integer from 0 to 65535");
    }
    return port;
}

std::string address_of(const std::string& text, const std::string& address, int family) {
    if (family == AF_INET && address == "localhost") {
        return "127.0.0.1";
    }
    std::array<unsigned char, sizeof(in6_addr)> raw{};
    if (address.find('\0') != std::string::npos || inet_pton(family, address.c_str(), raw.data()) != 1) {
        refuse(text, family == AF_INET6 ? "the text in brackets must be an IPv6 address"
                                        : "the address must be an IP address of this machine");
    }
    return address;
}

/// Whether the address is a loopback address: 127.0.0.0/8 or ::1.
bool is_loopback(const std::string& address) {
    in_addr v4{};
    if (inet_pton(AF_INET, address.c_str(), &v4) == 1) {
        return ntohl(v4.s_addr) >> 24 == 127;
    }
    in6_addr v6{};
    return inet_pton(AF_INET6, address.c_str(), &v6) == 1 && IN6_IS_ADDR_LOOPBACK(&v6) != 0;
}

}  // namespace

LiveViewSettings parse_view_address(const std::string& text) {
    LiveViewSettings settings;
    if (text.empty()) {
        return settings;
    }
    // "[IPv6]:PORT"
    if (text.front() == '[') {
        const std::size_t close = text.find("]:");
        if (close == std::string::npos) {
            refuse(text, "expected an IPv6 address in brackets, a colon and a port");
        }
        settings.address = address_of(text, text.substr(1, close - 1), AF_INET6);
        settings.port = port_of(text, std::string_view(text).substr(close + 2));
        return settings;
    }
    // "PORT"
    const std::size_t colon = text.find(':');
    if (colon == std::string::npos) {
        settings.port = port_of(text, text);
        return settings;
    }
    // "IPv4:PORT"
    if (text.find(':', colon + 1) != std::string::npos) {
        refuse(text, "an IPv6 address must be in brackets");
    }
    settings.address = address_of(text, text.substr(0, colon), AF_INET);
    settings.port = port_of(text, std::string_view(text).substr(colon + 1));
    return settings;
}

std::string exposure_of(const LiveViewSettings& settings) {
    if (is_loopback(settings.address)) {
        return "";
    }
    return "anyone who can reach " + settings.address + " can watch this run" +
           (settings.control ? " and change it" : "") +
           ", without a password; to allow only this machine, give --view without an address and connect through "
           "ssh -L 7060:localhost:7060 from elsewhere";
}

}  // namespace haptic::sim::view
