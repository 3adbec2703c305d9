// Who may talk to the view: a page that this host-sim served, or a program that is no browser. Pure.
//
// A page of another site must neither read the stream nor steer the hand. Its browser names that site as the Origin,
// which then is not the Host that was asked. A site whose name leads to this machine (DNS rebinding) would make both
// the same: so the Host has to be an address, localhost or the machine's own name, none of which such a site can have.
#pragma once

#include <string_view>

namespace haptic::sim::view {

/// Whether a request with this Host, "NAME" or "NAME:PORT", is meant for this machine, called `machine`.
[[nodiscard]] bool host_is_own(std::string_view host, std::string_view machine);

/// Whether a page from `origin`, "http://NAME:PORT", was served by `host`.
[[nodiscard]] bool origin_is_host(std::string_view origin, std::string_view host);

}  // namespace haptic::sim::view
