// Source of the tick's contact frames: the ring, or a recording.
#pragma once

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/ring.hpp"

namespace haptic::rt {

class FrameSource {
  public:
    virtual ~FrameSource() = default;

    /// Copies the newest frame. Returns false if there is none that was not returned before; as
    /// RingReader::read_newest().
    [[nodiscard]] virtual bool read_newest(ContactFrame& frame) HAPTIC_RT = 0;
};

class RingFrames final : public FrameSource {
  public:
    /// The reader must outlive the source.
    explicit RingFrames(RingReader<ContactFrame>& reader) : reader_(&reader) {}
    [[nodiscard]] bool read_newest(ContactFrame& frame) HAPTIC_RT override;

  private:
    RingReader<ContactFrame>* reader_;
};

}  // namespace haptic::rt
