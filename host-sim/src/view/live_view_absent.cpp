// In place of the live view, where it was not built.
#include <stdexcept>

#include "view/live_view.hpp"

namespace haptic::sim::view {

std::unique_ptr<LiveView> open_live_view(const LiveViewSettings& /*settings*/) {
    throw std::runtime_error(
        "this host-sim was built without the live view: " HAPTIC_VIEW_LACKS
        "; toolchain/setup build installs what it needs, and a build with -DHAPTIC_VIEW=ON says what is missing");
}

}  // namespace haptic::sim::view
