// Contact candidates: the triangles near each proxy of a tool in one step, collected with one traversal of each tree.
//
// The queries of a step, some dozen per proxy, all ask for the triangles near the same positions. So each proxy gets a
// box first: everywhere it can go, including where moving surfaces can carry it. One traversal of each tree tests the
// boxes of all proxies and lists, per proxy, the triangles in its box, with their boxes in single precision. A query
// inside the proxy's box goes through the list. A proxy that leaves its box, led along a fold toward a goal far away,
// gets a list for its new surroundings. Longer queries, and those whose list overflowed, go through the tree. The list
// changes how fast the answer comes, never the answer.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "contact/leaf_boxes.hpp"
#include "contact/scratch.hpp"
#include "contact/swept_tree.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Region that one proxy may reach in a step.
struct ProxyReach {
    Vec3 position{0.0};   // m, centre at the start
    Vec3 goal{0.0};       // m; beyond one radius per axis the queries go through the trees
    double radius = 0.0;  // m
};

class NearSurfaces;
struct LastContacts;

/// Candidate lists of all proxies. Fixed memory, about 50 kB a proxy. Not thread-safe: queries may renew a list.
class ContactCandidates {
  public:
    static constexpr std::size_t kMaxProxies = 64;

    /// Allocates; later calls do not. Throws std::invalid_argument for more than kMaxProxies.
    explicit ContactCandidates(std::size_t proxies);
    ContactCandidates(ContactCandidates&&) noexcept;
    ContactCandidates& operator=(ContactCandidates&&) noexcept;
    ~ContactCandidates();

    /// Collects the candidates of all proxies (at most as many as the constructor was given). Call once a step, after
    /// refitting the trees. Invalidates the results of of(). `surfaces` must outlive them.
    void collect(std::span<const MovingSurface> surfaces, std::span<const ProxyReach> proxies) noexcept;

    /// The surfaces as one proxy's queries see them, valid until the next collect(). Without a list it queries the
    /// trees.
    [[nodiscard]] NearSurfaces of(std::size_t proxy) noexcept;

    /// Surfaces of the last collect().
    [[nodiscard]] std::span<const MovingSurface> all() const noexcept { return surfaces_; }
    /// Number of candidates of a proxy after the last collect().
    [[nodiscard]] std::size_t listed(std::size_t proxy) const noexcept;
    /// Number of proxies whose list overflowed in the last collect(); their queries go through the trees.
    [[nodiscard]] std::size_t overflows() const noexcept;

  private:
    friend class NearSurfaces;

    static constexpr std::size_t kMaxListed = 512;  // triangles of one proxy
    static constexpr std::size_t kMaxRanges = 16;   // surfaces near one proxy
    static constexpr std::size_t kKinds = 2;        // of QueryTime

    /// Candidates of one surface in a proxy's list: [begin, end).
    struct SurfaceRange {
        std::uint32_t object;
        std::uint32_t begin;
        std::uint32_t end;
    };
    struct List {
        Aabb region;            // the box that was searched
        double radius = 0.0;    // m, of the proxy
        bool complete = false;  // false: overflow, query the trees
        std::uint32_t range_count = 0;
        std::uint32_t count = 0;
        Scratch<SurfaceRange, kMaxRanges> range;
        Scratch<std::uint32_t, kMaxListed> triangle;
        std::array<Scratch<PackedBox, kMaxListed>, kKinds> box;  // by QueryTime

        /// Empties the list for a new region.
        void clear(const Aabb& searched) noexcept {
            region = searched;
            complete = true;
            range_count = 0;
            count = 0;
        }
    };

    /// Replaces the list of a proxy that has left its region by one of the triangles around `box`, if that is small.
    static void follow(List& list, std::span<const MovingSurface> surfaces, const Aabb& box) noexcept;

    /// Appends the triangles of a leaf whose boxes overlap the list's region, given as `limits`.
    static void add(List& list, const BoxLimits& limits, std::uint32_t object, std::span<const std::uint32_t> triangles,
                    const LeafBoxes& boxes) noexcept;

    std::span<const MovingSurface> surfaces_;
    std::vector<List> lists_;
    std::vector<LastContacts> last_contacts_;  // per proxy
    std::size_t proxy_count_ = 0;              // of the last collect()
};

/// The surfaces as one proxy's queries see them: through its candidate list, or through the trees. A view, to be passed
/// by value.
class NearSurfaces {
  public:
    /// Queries the trees. Accepts any contiguous range of MovingSurface.
    template <class Surfaces>
        requires std::convertible_to<const Surfaces&, std::span<const MovingSurface>>
    NearSurfaces(const Surfaces& surfaces) noexcept : all_(surfaces) {}  // NOLINT(google-explicit-constructor)

    [[nodiscard]] std::size_t size() const noexcept { return all_.size(); }
    [[nodiscard]] const MovingSurface& operator[](std::size_t object) const noexcept { return all_[object]; }
    [[nodiscard]] std::span<const MovingSurface> all() const noexcept { return all_; }

    /// Where the proxy's phases hand on the contact points of its last position; null without candidates.
    [[nodiscard]] LastContacts* last_contacts() const noexcept { return last_contacts_; }

    /// Whether no surface enters the box during the step, by the boxes of the proxy's candidates or, outside its
    /// region, those of whole surfaces: the test of free air, before a phase sets up any query. False where a surface
    /// may be near.
    [[nodiscard]] bool is_clear(const Aabb& box) const noexcept {
        return is_far(box) || (list_covers(box) && list_is_clear(box));
    }

    /// Whether the boxes of whole surfaces are apart from this one during the step, or the proxy has no candidates.
    [[nodiscard]] bool is_far(const Aabb& box) const noexcept {
        if (list_ != nullptr && list_->range_count == 0 && list_covers(box)) {
            return true;
        }
        return std::none_of(all_.begin(), all_.end(), [&](const MovingSurface& s) { return s.tree->overlaps(box); });
    }

    /// Calls visit(triangle index) for every triangle of a surface that enters the swept sphere at a time covered by
    /// `when`, and for some that do not. The order is always the same. No allocation.
    template <class Visit>
    void query(std::uint32_t object, const SweptSphere& sphere, QueryTime when, Visit&& visit) const {
        const SweptTree& tree = *all_[object].tree;
        if (!tree.overlaps(sphere.box)) {
            return;
        }
        const SphereLimits limits(sphere);
        if (list_ != nullptr && !list_covers(sphere.box)) {
            ContactCandidates::follow(*list_, all_, sphere.box);
        }
        if (!list_covers(sphere.box)) {
            tree.query_leaves(sphere.box, [&](std::uint32_t leaf) {
                const std::span<const std::uint32_t> triangles = tree.triangles_of(leaf);
                const LeafBoxes boxes(all_[object], leaf, when);
                for (std::size_t k = 0; k < triangles.size(); ++k) {
                    if (limits.overlap(boxes.at(when, k))) {
                        visit(triangles[k]);
                    }
                }
            });
            return;
        }
        const auto& boxes = list_->box[static_cast<std::size_t>(when)];
        for (std::uint32_t r = 0; r < list_->range_count; ++r) {
            if (list_->range[r].object != object) {
                continue;
            }
            for (std::uint32_t k = list_->range[r].begin; k < list_->range[r].end; ++k) {
                if (limits.overlap(boxes[k])) {
                    visit(list_->triangle[k]);
                }
            }
        }
    }

  private:
    friend class ContactCandidates;
    NearSurfaces(std::span<const MovingSurface> all, ContactCandidates::List* list, LastContacts* last) noexcept
        : all_(all), list_(list), last_contacts_(last) {}

    /// Whether the list holds every triangle that may be in the box.
    [[nodiscard]] bool list_covers(const Aabb& box) const noexcept {
        return list_ != nullptr && list_->complete && contains(list_->region, box);
    }

    /// Whether no candidate enters a box that the list covers.
    [[nodiscard]] bool list_is_clear(const Aabb& box) const noexcept {
        const BoxLimits limits(box);
        const PackedBox* const boxes = list_->box[static_cast<std::size_t>(QueryTime::WholeStep)].data();
        return std::none_of(boxes, boxes + list_->count, [&](const PackedBox& b) { return limits.overlap(b); });
    }

    std::span<const MovingSurface> all_;
    ContactCandidates::List* list_ = nullptr;
    LastContacts* last_contacts_ = nullptr;
};

}  // namespace haptic::sim
