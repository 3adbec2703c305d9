#include "haptic/probe.hpp"

namespace haptic {

void Probe::set(bool up) HAPTIC_RT {
    if (line_ == nullptr || error_ != 0 || up == up_) {
        return;
    }
    error_ = line_->set(up);
    if (error_ == 0) {
        up_ = up;
        ++edges_;
    }
}

}  // namespace haptic
