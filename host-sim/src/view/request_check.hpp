// Request check: accepts requests from pages served by this host-sim and from programs other than browsers. Pure
// functions.
//
// A page of another site must neither read the stream nor control the hand. Its browser sends that site as the Origin,
// which then differs from the Host. With DNS rebinding, a foreign site's name resolves to this machine and both are
// equal; therefore the Host must be an IP address, localhost or the machine's own name, which no such site can have.
#pragma once

#include <string_view>

namespace haptic::sim::view {

/// Whether a Host header, "NAME" or "NAME:PORT", names this machine, whose host name is `machine`.
[[nodiscard]] bool host_is_own(std::string_view host, std::string_view machine);

/// Whether a page from `origin`, "http://NAME:PORT", was served by `host`.
[[nodiscard]] bool origin_is_host(std::string_view origin, std::string_view host);

}  // namespace haptic::sim::view
