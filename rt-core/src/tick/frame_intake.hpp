// Frame intake: where the tick's contact frames are read and prepared (prepared_frame.hpp): in the tick itself, or
// ahead of it in a thread (process/frame_thread.hpp).
#pragma once

#include <cstdint>

#include "haptic/realtime.hpp"
#include "rendering/prepared_frame.hpp"
#include "tick/slot_source.hpp"

namespace haptic::rt {

class FrameIntake {
  public:
    virtual ~FrameIntake() = default;

    /// Puts the newest frame into the inbox, prepared, or in place of it: the frame that was there is then the
    /// intake's. Returns false if there is none that was not taken before; the inbox stays. For the tick with this
    /// deadline.
    [[nodiscard]] virtual bool take(PreparedFrame*& inbox, std::int64_t deadline_ns) HAPTIC_RT = 0;
    /// The end of this tick, from which a frame starts that the next one takes.
    virtual void expect(const FrameStart& /*start*/) HAPTIC_RT {}
};

/// Reads and prepares in the tick: a frame is rendered in the tick that finds it.
class FrameIntakeInTick final : public FrameIntake {
  public:
    /// The source must outlive the intake.
    explicit FrameIntakeInTick(FrameSource& source) : source_(&source) {}
    [[nodiscard]] bool take(PreparedFrame*& inbox, std::int64_t deadline_ns) HAPTIC_RT override;

  private:
    FrameSource* source_;
};

}  // namespace haptic::rt
