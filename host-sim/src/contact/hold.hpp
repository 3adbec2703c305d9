// What holds a proxy at a place against a goal: the planes of all that it touches there, and the nearest point to the
// goal that they leave.
#pragma once

#include <span>

#include "contact/touching.hpp"

namespace haptic::sim {

class Hold {
  public:
    /// Looks round the sphere where it is at the end of the step.
    void look(const NearSurfaces& surfaces, const Vec3& at, const Vec3& goal, double radius,
              const ContactSettings& settings) noexcept;

    /// The point nearest to the goal beyond all planes, with the largest radius that there is room for.
    [[nodiscard]] const PlaneSet::Room& room() const noexcept { return room_; }
    [[nodiscard]] std::span<const Touching> points() const noexcept { return touching_.points(); }
    /// The planes that hold that point; `dt` (s) turns displacements into velocities.
    [[nodiscard]] SurfacePlanes planes(const NearSurfaces& surfaces, double dt) const noexcept;

  private:
    TouchingSet touching_;
    PlaneSet planes_;
    PlaneSet::Room room_;
};

}  // namespace haptic::sim
