#include "tick/frame_source.hpp"

namespace haptic::rt {

bool RingFrames::read_newest(ContactFrame& frame) HAPTIC_RT {
    return reader_->read_newest(frame);
}

}  // namespace haptic::rt
