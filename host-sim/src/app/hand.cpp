#include "app/hand.hpp"

#include <cmath>

namespace haptic::sim {

const char* find_defect(const DeviceState& state) noexcept {
    double length_squared = 0.0;
    for (const double q : state.orientation) {
        length_squared += q * q;
    }
    for (const double x : state.position) {
        if (!std::isfinite(x)) {
            return "position is not finite";
        }
    }
    if (!(std::fabs(length_squared - 1.0) < 1e-5)) {
        return "orientation is not of unit length";
    }
    return nullptr;
}

StepInput DeviceHand::at(std::int64_t time_ns, std::int64_t now_ns) {
    DeviceState state;
    if (states_->read_newest(state)) {
        if (find_defect(state) == nullptr) {
            input_ = input_from(state, time_ns);
            latest_ns_ = state.latch_time_ns;
            safety_state_ = state.safety_state;
        } else {
            ++rejected_;
        }
    }
    fresh_ = latest_ns_ != 0 && now_ns - latest_ns_ <= kFreshNs;
    if (!fresh_) {
        input_.buttons = 0;  // a button that is not reported counts as released
    }
    input_.time_ns = time_ns;
    return input_;
}

}  // namespace haptic::sim
