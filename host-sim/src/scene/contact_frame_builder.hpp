// Contact frame builder: converts the result of a step into the frame that the haptic loop receives.
#pragma once

#include <span>

#include "haptic/frames.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/scene_body.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/sim/workspace.hpp"
#include "haptic/types.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {

/// State of the scene after a step from t to t + dt. The contact planes hold at t.
struct ContactFrameSources {
    const StepInput& input;
    const Scene& scene;
    const Workspace& workspace;
    const Clutch& clutch;
    const ToolProxies& tool;
    double damping = 0.0;  // N*s/m, scene; ToolForce::damping
    std::span<const SceneBody> bodies;
    std::span<const Vec3> start;  // m, scene: vertices of all bodies at t
    std::span<const Vec3> end;    // and at t + dt
};

class ContactFrameBuilder {
  public:
    explicit ContactFrameBuilder(const ContactFrameSources& sources) : sources_(sources) {}

    /// Fills all fields but sequence and session, which the ring sets. Device frame. No allocation.
    void build(ContactFrame& frame) const;

  private:
    void write_proxy_contact(const ToolProxy& proxy, ProxyContact& out) const;
    [[nodiscard]] Vec3 travel_of(const SurfacePoint& touched) const;

    const ContactFrameSources& sources_;
};

}  // namespace haptic::sim
