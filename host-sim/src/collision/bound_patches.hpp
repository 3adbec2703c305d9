// Vertices of pairs that pushes do not keep apart: they are bound, and go as far as planes between them permit.
//
// For each pair there is a plane in the middle of the gap in which it was at the start, and each vertex goes as far
// toward its end as it can without leaving its side of the planes. Planes may move. Bound vertices of pairs that are
// bound as a whole form a patch; the planes of a patch share one motion: the mean of those asked of its vertices that
// are led, else of those of exact surfaces, else of all; and they give way to exact surfaces. A vertex alone on its
// side of a plane needs to know nothing of the others, so bound vertices keep their gaps however many there are.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "collision/listed_pairs.hpp"
#include "collision/surface_paths.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

class SurfacePairs;  // surface_pairs.hpp

class BoundPatches {
  public:
    /// `paths` outlive it.
    explicit BoundPatches(SurfacePaths& paths);
    BoundPatches(const BoundPatches&) = delete;
    BoundPatches& operator=(const BoundPatches&) = delete;

    /// Sets all vertices free.
    void begin_attempt() noexcept;
    /// Binds the vertices of each of these pairs in one patch. Whether any were not yet.
    [[nodiscard]] bool bind(std::span<const UnsafePair> unsafe);
    /// Moves the bound vertices as far toward their asked ends as the planes of their pairs, which are listed, permit.
    void move(SurfacePairs& pairs);
    /// Whether these vertices keep to the sides of the planes of their patch, once they have been moved. Those that
    /// follow exact surfaces do so roughly only, and those that go as they are asked if that is as their patch goes.
    [[nodiscard]] bool is_kept_by_planes(const PairVertices& vertex) const noexcept;

  private:
    /// Bound vertices that meet.
    struct Patch {
        struct Sum {
            Vec3 motion{0.0};  // m
            double vertices = 0.0;
        };
        Sum yielding;                                           // of vertices that can be pushed
        Sum led;                                                // of others
        Sum exact;                                              // of exact surfaces
        Vec3 motion{0.0};                                       // m, in common
        double lowest = std::numeric_limits<double>::lowest();  // m: the least way up that keeps all above the floor
    };

    /// A plane between the features of a pair.
    struct Sides {
        Vec3 normal{0.0};
        Vec3 common{0.0};              // m, its motion
        double middle = 0.0;           // m, along the normal, at the end of the way less the common motion
        double half = 0.0;             // m, the distance that vertices keep from it
        std::array<double, 4> sign{};  // of the side, per vertex
    };

    [[nodiscard]] bool meets_exact(const PairVertices& v) const noexcept {
        return paths_.is_exact(v[0]) || paths_.is_exact(v[3]);
    }
    void find_common_motions();
    void find_led(SurfacePairs& pairs);
    template <class Visit>
    void for_each_bound_pair(SurfacePairs& pairs, const Visit& visit) const;
    [[nodiscard]] Sides sides_of(ListedPairs& list, std::size_t at) const noexcept;
    void keep_to_sides(ListedPairs& list, std::size_t at) noexcept;

    SurfacePaths& paths_;
    bool some_are_exact_;  // surfaces
    std::vector<std::uint32_t> bound_;
    // Per vertex.
    std::vector<double> part_;         // bound: of the way from where it is led to the end as it was given
    std::vector<Patch> patch_;         // of the vertex that its patch is named after
    std::vector<Vec3> led_;            // bound: m, the motion on which its part of the rest is added
    std::vector<Patch::Sum> led_sum_;  // bound: of the motions of exact features that it meets
};

}  // namespace haptic::sim
