// Particles of some bodies that move as one rigid body over a step, and rest on a floor with points of their surfaces.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <span>

#include "dynamics/rigid_motion.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Of a rigid body: the way of its centre of mass, m, and a rotation vector, rad; or velocities, m/s and rad/s.
struct Twist {
    Vec3 linear{0.0};
    Vec3 angular{0.0};

    /// Way or velocity at an arm, m, from the centre of mass.
    [[nodiscard]] Vec3 at(const Vec3& arm) const noexcept { return linear + glm::cross(angular, arm); }
};

/// Mass, kg, centre of mass, m, and scatter matrix about it, kg m^2.
struct RigidGroup {
    double mass = 0.0;
    Vec3 centre{0.0};
    Mat3 scatter{0.0};
};

/// Points of a group that rest on a floor.
class FloorSupports {
  public:
    [[nodiscard]] bool is_empty() const noexcept { return count_ == 0; }
    /// A point, of this name, m, goes up by so much more than a way leads it, of a body with this centre. False: there
    /// are too many points, or raises.
    [[nodiscard]] bool raise(std::uint32_t name, const Vec3& point, const Vec3& centre, double more,
                             const Twist& way) noexcept;
    /// The points that were pushed have made a motion, with the centre, and are not to go down any more.
    void stop(const RigidMotion& motion, const Vec3& centre) noexcept;
    /// Changes a twist so that no point goes up less than it has to: pushes up, with friction. Points that go up by
    /// themselves get none.
    /// @source projected Gauss-Seidel with Coulomb friction: J. J. Moreau, "Numerical Aspects of the Sweeping Process",
    /// 1999
    void hold_up(const RigidGroup& group, double friction, Twist& twist) noexcept;

  private:
    static constexpr std::size_t kMost = 16;
    struct Support {
        std::uint32_t name = 0;
        Vec3 point{0.0};     // m
        Vec3 arm{0.0};       // m, from the centre of mass
        double least = 0.0;  // way or velocity up
        Vec3 push{0.0};      // kg times its unit
    };

    std::array<Support, kMost> supports_;
    std::size_t count_ = 0;
    int raised_ = 0;
};

}  // namespace haptic::sim
