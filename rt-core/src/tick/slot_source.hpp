// Sources of what the tick receives, contact frames and wrench overlays: a ring, or a recording.
#pragma once

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/ring.hpp"

namespace haptic::rt {

template <class Slot>
class SlotSource {
  public:
    virtual ~SlotSource() = default;

    /// Copies the newest slot. Returns false if there is none that was not returned before; as
    /// RingReader::read_newest().
    [[nodiscard]] virtual bool read_newest(Slot& slot) HAPTIC_RT = 0;
};

template <class Slot>
class RingSource final : public SlotSource<Slot> {
  public:
    /// The reader must outlive the source.
    explicit RingSource(RingReader<Slot>& reader) : reader_(&reader) {}
    [[nodiscard]] bool read_newest(Slot& slot) HAPTIC_RT override;

  private:
    RingReader<Slot>* reader_;
};

extern template class RingSource<ContactFrame>;
extern template class RingSource<WrenchOverlay>;

using FrameSource = SlotSource<ContactFrame>;
using OverlaySource = SlotSource<WrenchOverlay>;
using RingFrames = RingSource<ContactFrame>;
using RingOverlays = RingSource<WrenchOverlay>;

}  // namespace haptic::rt
