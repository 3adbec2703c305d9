#include "view/request_check.hpp"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string>

namespace haptic::sim::view {
namespace {

char lower(char c) noexcept {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

bool same_name(std::string_view a, std::string_view b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) { return lower(x) == lower(y); });
}

bool is_port(std::string_view text) {
    unsigned port = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
    return error == std::errc() && end == text.data() + text.size() && port > 0 && port <= 65535;
}

bool is_address(int family, std::string_view text) {
    std::array<unsigned char, sizeof(in6_addr)> address{};
    return inet_pton(family, std::string(text).c_str(), address.data()) == 1;
}

/// The host part before ":PORT", without the brackets of an IPv6 address; empty if the text is malformed.
struct Name {
    std::string_view text;
    bool bracketed = false;
};
std::optional<Name> name_of(std::string_view host) {
    if (host.find('\0') != std::string_view::npos) {
        return std::nullopt;
    }
    // "[IPv6]" or a name up to the colon.
    Name name;
    std::string_view rest;
    // The name ends at the bracket or at the colon.
    if (host.starts_with('[')) {
        const std::size_t close = host.find(']');
        if (close == std::string_view::npos) {
            return std::nullopt;
        }
        name = {host.substr(1, close - 1), true};
        rest = host.substr(close + 1);
    } else {
        const std::size_t colon = std::min(host.find(':'), host.size());
        name = {host.substr(0, colon), false};
        rest = host.substr(colon);
    }
    // The remainder must be nothing or a port.
    if (!rest.empty() && (rest.front() != ':' || !is_port(rest.substr(1)))) {
        return std::nullopt;
    }
    return name;
}

}  // namespace

bool host_is_own(std::string_view host, std::string_view machine) {
    const std::optional<Name> name = name_of(host);
    if (!name || name->text.empty()) {
        return false;
    }
    if (name->bracketed) {
        return is_address(AF_INET6, name->text);
    }
    return is_address(AF_INET, name->text) || same_name(name->text, "localhost") || same_name(name->text, machine);
}

bool origin_is_host(std::string_view origin, std::string_view host) {
    for (const std::string_view scheme : {"http://", "https://"}) {
        if (origin.starts_with(scheme)) {
            return same_name(origin.substr(scheme.size()), host);
        }
    }
    return false;
}

}  // namespace haptic::sim::view
