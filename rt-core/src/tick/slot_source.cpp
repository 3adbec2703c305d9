#include "tick/slot_source.hpp"

namespace haptic::rt {

template <class Slot>
bool RingSource<Slot>::read_newest(Slot& slot) HAPTIC_RT {
    return reader_->read_newest(slot);
}

template class RingSource<ContactFrame>;
template class RingSource<WrenchOverlay>;

}  // namespace haptic::rt
