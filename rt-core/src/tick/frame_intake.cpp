#include "tick/frame_intake.hpp"

namespace haptic::rt {

bool FrameIntakeInTick::take(PreparedFrame*& inbox, std::int64_t /*deadline_ns*/) HAPTIC_RT {
    if (!source_->read_newest(inbox->frame)) {
        return false;
    }
    inbox->prepare();
    return true;
}

}  // namespace haptic::rt
