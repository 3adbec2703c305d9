// Contact frame publisher: sends contact frames to the haptic loop, also while the scene is idle.
//
// A viewer may pause the scene or have another one built, for any length of time. The loop must not go on rendering an
// old frame, nor moving planes while the hand leaves the position that they were found for. While the scene is idle,
// the last frame is therefore repeated with its planes at rest and its stiffness fading to zero; then the hand is free.
// To continue, call Simulation::recouple().
#pragma once

#include <cstdint>
#include <string>

#include "haptic/frames.hpp"
#include "haptic/ring.hpp"

namespace haptic::sim {

class ContactFramePublisher {
  public:
    static constexpr double kFade = 0.1;                      // s, from full stiffness to zero
    static constexpr std::int64_t kIdlePeriodNs = 5'000'000;  // period of frames while idle

    /// Throws RingError.
    explicit ContactFramePublisher(const std::string& session) : ring_(session) {}

    /// Publishes the frame of a step. Returns its sequence number.
    std::uint64_t publish(const ContactFrame& frame, std::int64_t publish_ns, std::int64_t now_ns);
    /// Repeats the last frame; to be called every kIdlePeriodNs while idle. Returns the sequence number; 0 before the
    /// first frame.
    std::uint64_t publish_idle(std::int64_t now_ns);
    /// The stiffness has faded to zero.
    [[nodiscard]] bool faded() const noexcept { return gain_ <= 0.0; }
    void beat(std::int64_t now_ns) { ring_.beat(now_ns); }

  private:
    RingWriter<ContactFrame> ring_;
    ContactFrame frame_{};
    std::int64_t last_ns_ = 0;
    double gain_ = 0.0;  // 0..1, factor of the stiffness
};

}  // namespace haptic::sim
