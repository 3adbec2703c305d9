// In place of the live view, where it was not built.
#include <stdexcept>

#include "view/live_view.hpp"

namespace haptic::sim::view {

std::unique_ptr<LiveView> open_live_view(const LiveViewSettings& /*settings*/) {
    throw std::runtime_error(
        "this host-sim was built without the live view, because " HAPTIC_VIEW_LACKS
        "; install it (toolchain/setup build), and build again with -DHAPTIC_VIEW=ON, which says what is missing");
}

}  // namespace haptic::sim::view
