// The way of the frames to the haptic loop, also while the scene stands.
//
// A viewer may pause the scene, or have another one made, for as long as that takes. The loop must not go on rendering
// a frame that grows old, nor feel planes that nobody moves on while the hand leaves the place that they were found
// for. So while the scene stands, its last frame goes out again and again, its planes at rest, its stiffness fading to
// nothing; then the hand is free. Who lets the scene go on couples it anew (Simulation::couple_anew()).
#pragma once

#include <cstdint>
#include <string>

#include <haptic/frames.hpp>
#include <haptic/ring.hpp>

namespace haptic::sim {

class FrameOutlet {
  public:
    static constexpr double kFade = 0.1;                 // s, from full stiffness to none
    static constexpr std::int64_t kStandNs = 5'000'000;  // between two frames of a scene that stands

    /// Throws RingError.
    explicit FrameOutlet(const std::string& session) : ring_(session) {}

    /// Publishes what a step found. Returns its sequence.
    std::uint64_t publish(const ContactFrame& frame, std::int64_t publish_ns, std::int64_t now_ns);
    /// To be called every kStandNs while the scene stands. Returns the sequence; 0 before the first frame.
    std::uint64_t stand(std::int64_t now_ns);
    /// The hand feels nothing: the scene has stood for so long.
    [[nodiscard]] bool faded() const noexcept { return felt_ <= 0.0; }
    void beat(std::int64_t now_ns) { ring_.beat(now_ns); }

  private:
    RingWriter<ContactFrame> ring_;
    ContactFrame frame_{};
    std::int64_t last_ns_ = 0;
    double felt_ = 0.0;  // part of the stiffness, 0..1
};

}  // namespace haptic::sim
