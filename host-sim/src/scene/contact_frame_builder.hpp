// Contact frame builder: converts the result of a step into the frame that the haptic loop receives.
//
// A step from t to t + dt has been computed when its frame is built, so the planes' motion during the step is known.
// Each plane leaves from where its force is at t, offset + lead, and arrives at t + dt where it is then:
//
//     offset(t) = o + lead_start      velocity = (n . travel + lead_end - lead_start) / dt
//
// with o the offset of the surface, `travel` the displacement of the touched point in the step, and the lead by damping
// of contact_coupling.hpp. The loop extrapolates beyond t + dt only while the next frame is late.
#pragma once

#include <span>

#include "haptic/frames.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/scene_body.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/sim/workspace.hpp"
#include "haptic/types.hpp"
#include "tool/contact_coupling.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {

/// State of the scene after a step from t to t + dt. The contact planes hold at t.
struct ContactFrameSources {
    const StepInput& input;
    const Scene& scene;
    const Workspace& workspace;
    const Clutch& clutch;
    const ToolProxies& tool;
    const ContactCoupling& coupling;
    std::span<const SceneBody> bodies;
    std::span<const Vec3> start;  // m, scene: vertices of all bodies at t
    std::span<const Vec3> end;    // and at t + dt
    double body_work;             // J, device: of all steps
};

class ContactFrameBuilder {
  public:
    explicit ContactFrameBuilder(const ContactFrameSources& sources) : sources_(sources) {}

    /// Fills all fields but sequence and session, which the ring sets. Device frame. No allocation.
    void build(ContactFrame& frame) const;

  private:
    void limit_rows(ContactFrame& frame) const;
    void write_compliance(ContactFrame& frame) const;
    void write_proxy_contact(std::size_t index, ProxyContact& out) const;
    [[nodiscard]] Vec3 travel_of(const SurfacePoint& touched) const;

    const ContactFrameSources& sources_;
};

}  // namespace haptic::sim
