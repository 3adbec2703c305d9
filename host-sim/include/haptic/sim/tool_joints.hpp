// How a tool closes: joints about which parts of its rest shape turn, by one number.
//
// The curl goes from 0, the shape in which the tool was made, to 1, closed. Joint j turns what hangs on it by
// 2 atan(c |w_j| / 2) about w_j (the Cayley map, rotation.hpp), c being the curl over that at which the joint is done
// turning, and is taken along by the joint before it. So a curl
// gives each particle a rest place and a rest orientation; nothing is integrated and nothing remembers the curl before,
// which is what the haptic constraint needs (thesis, equation 5.1, with o_i a function of the curl). The thesis' hand
// keeps its shape (section 5.7).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <span>
#include <vector>

#include "haptic/types.hpp"

namespace haptic::sim {

struct ToolJoint {
    std::uint32_t parent = 0;  // that takes it along, before it in the list; the first one is its own and never turns
    Vec3 place{0.0};           // m, at curl 0
    Vec3 turn{0.0};            // of turned(), when it is done, as the tool is at curl 0
    double done_at = 1.0;      // curl, more than 0, from which on it turns no farther
};

/// What a joint moves: a ball that goes from one place to the other, and grows on its way.
struct ToolBone {
    std::uint32_t joint = 0;
    Vec3 from{0.0};            // m, at curl 0
    double from_radius = 0.0;  // m
    Vec3 to{0.0};
    double to_radius = 0.0;
};

struct ToolSkeleton {
    std::vector<ToolJoint> joints;
    std::vector<ToolBone> bones;
};

/// m, about, of a point from the flesh about a bone; negative inside.
[[nodiscard]] inline double distance(const Vec3& p, const ToolBone& bone) noexcept {
    const Vec3 along = bone.to - bone.from;
    const double t = std::clamp(glm::dot(p - bone.from, along) / glm::dot(along, along), 0.0, 1.0);
    return glm::length(p - (bone.from + t * along)) - (bone.from_radius + t * (bone.to_radius - bone.from_radius));
}

class ToolJoints {
  public:
    /// None: the tool has one shape.
    ToolJoints() = default;
    /// Each place is moved by the bone that it is deepest in, or nearest to. Throws std::invalid_argument: no joints or
    /// bones, a parent that does not come before, a joint that is not there.
    ToolJoints(const ToolSkeleton& skeleton, std::span<const Vec3> places);

    [[nodiscard]] bool empty() const noexcept { return of_place_.empty(); }
    [[nodiscard]] std::size_t joints() const noexcept { return joints_.size(); }
    /// The joint that moves a place.
    [[nodiscard]] std::uint32_t joint_of(std::size_t place) const { return of_place_[place]; }

    /// Writes where the places are at a curl of 0..1, and how what is there is turned against curl 0. As many as the
    /// constructor got. No allocation, no libm but sqrt.
    void close(double curl, std::span<Vec3> places, std::span<Quat> turns) noexcept;

  private:
    struct Moved {
        Vec3 place{0.0};
        Quat turn{1.0, 0.0, 0.0, 0.0};
    };

    std::vector<ToolJoint> joints_;
    std::vector<std::uint32_t> of_place_;
    std::vector<Vec3> lever_;   // m, per place: from its joint, at curl 0
    std::vector<Moved> moved_;  // per joint; the first stays
};

}  // namespace haptic::sim
