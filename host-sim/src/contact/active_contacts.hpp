// Active contacts: the planes that a proxy touches at a position, and the nearest point to its goal outside them.
#pragma once

#include <span>

#include "contact/contact_points.hpp"

namespace haptic::sim {

class ActiveContacts {
  public:
    /// Collects the planes around a sphere at `at`, at the end of the step, and projects the goal onto them.
    void update(const NearSurfaces& surfaces, const Vec3& at, const Vec3& goal, double radius,
                const ContactSettings& settings) noexcept;

    /// Nearest point to the goal outside all planes, with the largest radius that fits.
    [[nodiscard]] const PlaneSet::Fit& fit() const noexcept { return fit_; }
    [[nodiscard]] std::span<const ContactPoint> points() const noexcept { return contact_set_.points(); }
    /// The active planes of that point. `dt` (s) turns displacements into velocities.
    [[nodiscard]] SurfacePlanes planes(const NearSurfaces& surfaces, double dt) const noexcept;

  private:
    ContactPointSet contact_set_;
    PlaneSet planes_;
    PlaneSet::Fit fit_;
};

}  // namespace haptic::sim
