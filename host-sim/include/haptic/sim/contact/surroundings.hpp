// What the proxies of a tool may meet in one step, found by one walk through each tree for all of them.
//
// The queries of a step, some dozen for each proxy, all ask for the triangles near the same places. So before them each
// proxy gets a box: where it can go from where it stands, with the surfaces that move there. One walk through each tree
// takes the boxes of all proxies along and lists, per proxy, the triangles in its box, with boxes of their own, in
// single precision, rounded outwards, four side by side. A query within the box then goes through this list, one that
// leaves it, or finds it full, through the tree: what is listed decides how fast the answer comes, never what it is.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "contact/swept_tree.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Where one proxy may go in a step.
struct ProxyReach {
    Vec3 position{0.0};   // m, where it stands
    Vec3 goal{0.0};       // m, where it is led; of one that is farther away the rest is left to the trees
    double radius = 0.0;  // m
    double margin = 0.0;  // m, how far from the goal it may be led otherwise
};

/// Which places of a triangle a query is about.
enum class When : std::uint8_t {
    Step,  // any in the step
    End,   // that at its end
};

/// The room that a sphere sweeps on a straight way.
struct SweptBall {
    SweptBall(const Vec3& from, const Vec3& to, double radius) noexcept;

    Box box;
    Vec3 center;         // m, of a sphere
    double outer = 0.0;  // m, that holds it
};

class NearSurfaces;

/// Fixed memory, about 14 kB a proxy; to be used by one thread.
class Surroundings {
  public:
    static constexpr std::size_t kMaxProxies = 64;

    /// Throws std::invalid_argument for more than kMaxProxies. Allocates; nothing after does.
    explicit Surroundings(std::size_t proxies);

    /// Looks round all proxies, as many as there are elements and at most as many as there is memory for. To be called
    /// once a step, after the trees were refitted; what of() gave before is invalid then. `surfaces` has to stay.
    void collect(std::span<const MovingSurface> surfaces, std::span<const ProxyReach> proxies) noexcept;

    /// The surfaces for the queries of one proxy, until the next collect(). One that was not collected asks the trees.
    [[nodiscard]] NearSurfaces of(std::size_t proxy) const noexcept;

    /// What the last collect() was given.
    [[nodiscard]] std::span<const MovingSurface> all() const noexcept { return surfaces_; }
    /// Triangles that the last collect() listed for a proxy.
    [[nodiscard]] std::size_t listed(std::size_t proxy) const noexcept;
    /// Proxies of the last collect() that found too much to list, and so ask the trees.
    [[nodiscard]] std::size_t overflows() const noexcept;

  private:
    friend class NearSurfaces;

    static constexpr std::size_t kLanes = 4;        // numbers in a register, on every machine that we build for
    static constexpr std::size_t kMaxListed = 256;  // triangles of one proxy, surfaces begin at whole registers
    static constexpr std::size_t kMaxRuns = 16;     // surfaces near one proxy
    static constexpr std::size_t kKinds = 2;        // of When

    using Lanes = float __attribute__((vector_size(16)));
    using LaneBits = std::int32_t __attribute__((vector_size(16)));
    /// Boxes as [low | -high]: numbers of one bound side by side.
    template <std::size_t Count>
    struct Boxes {
        alignas(Lanes) std::array<std::array<float, Count>, 6> bound;

        void set(std::size_t at, const Box& box) noexcept;
        [[nodiscard]] Lanes load(std::size_t which, std::size_t at) const noexcept {
            Lanes lanes;
            __builtin_memcpy(&lanes, &bound[which][at], sizeof(lanes));
            return lanes;
        }
    };
    /// What boxes are compared with.
    using BoxLimits = std::array<Lanes, 6>;  // [high | -low]
    struct BallLimits {
        explicit BallLimits(const SweptBall& ball) noexcept;

        BoxLimits box;
        std::array<Lanes, 3> center{};
        Lanes squared{};  // radius of the sphere
    };

    /// What a proxy has of one surface.
    struct Run {
        std::uint32_t object;
        std::uint32_t begin;  // a whole number of registers
        std::uint32_t end;
    };
    struct List {
        Box region;             // what was looked through
        BoxLimits limits{};     // of it
        bool complete = false;  // false: ask the trees
        std::uint32_t run_count = 0;
        std::uint32_t count = 0;
        std::array<Run, kMaxRuns> run{};
        std::array<std::uint32_t, kMaxListed> triangle{};
        std::array<Boxes<kMaxListed>, kKinds> box{};  // by When
    };
    using LeafBoxes = std::array<Boxes<SweptTree::kMostInLeaf>, kKinds>;

    static void make_boxes(LeafBoxes& boxes, const SurfaceMotion& motion,
                           std::span<const std::uint32_t> triangles) noexcept;
    /// Adds those that may meet the region of the list.
    static void add(List& list, std::uint32_t object, std::span<const std::uint32_t> triangles,
                    const LeafBoxes& boxes) noexcept;
    /// Room for one more triangle; false if there is none.
    [[nodiscard]] static bool make_room(List& list, std::uint32_t object) noexcept;

    [[nodiscard]] static BoxLimits limits_of(const Box& box) noexcept;
    /// Bit k: box at + k may meet the limits.
    template <std::size_t Count>
    [[nodiscard]] static std::uint32_t meeting(const Boxes<Count>& box, std::size_t at,
                                               const BoxLimits& limit) noexcept {
        LaneBits meets = LaneBits{1, 2, 4, 8};
        for (std::size_t k = 0; k < limit.size(); ++k) {
            meets &= box.load(k, at) <= limit[k];
        }
        return any(meets);
    }
    /// The same for those that may meet the sphere too.
    template <std::size_t Count>
    [[nodiscard]] static std::uint32_t meeting(const Boxes<Count>& box, std::size_t at,
                                               const BallLimits& limit) noexcept {
        const std::uint32_t meets = meeting(box, at, limit.box);
        if (meets == 0) {
            return 0;
        }
        Lanes squared{};
        for (std::size_t k = 0; k < 3; ++k) {
            const Lanes below = box.load(k, at) - limit.center[k];
            const Lanes above = box.load(k + 3, at) + limit.center[k];
            const Lanes outside = below > above ? below : above;
            squared += outside > Lanes{} ? outside * outside : Lanes{};
        }
        return meets & any((squared <= limit.squared) & LaneBits{1, 2, 4, 8});
    }
    [[nodiscard]] static std::uint32_t any(const LaneBits& lanes) noexcept {
        return static_cast<std::uint32_t>(lanes[0] | lanes[1] | lanes[2] | lanes[3]);
    }

    std::span<const MovingSurface> surfaces_;
    std::vector<List> lists_;
    std::size_t proxy_count_ = 0;  // of the last collect()
};

/// The surfaces as the queries of one proxy see them: through what was collected, or through the trees. Small, to be
/// passed on; it owns nothing.
class NearSurfaces {
  public:
    /// Through the trees. Any contiguous range of MovingSurface will do.
    template <class Surfaces>
        requires std::convertible_to<const Surfaces&, std::span<const MovingSurface>>
    NearSurfaces(const Surfaces& surfaces) noexcept : all_(surfaces) {}  // NOLINT(google-explicit-constructor)

    [[nodiscard]] std::size_t size() const noexcept { return all_.size(); }
    [[nodiscard]] const MovingSurface& operator[](std::size_t object) const noexcept { return all_[object]; }
    [[nodiscard]] std::span<const MovingSurface> all() const noexcept { return all_; }

    /// Calls visit(triangle index) for every triangle of a surface that comes into the ball at some time that `when`
    /// names, and for some that do not; always in the same order. No allocation.
    template <class Visit>
    void query(std::uint32_t object, const SweptBall& ball, When when, Visit&& visit) const {
        const SweptTree& tree = *all_[object].tree;
        if (!tree.meets(ball.box)) {
            return;
        }
        if (!is_listed(ball.box)) {
            tree.query(ball.box, visit);
            return;
        }
        const Surroundings::BallLimits limit(ball);
        const auto& boxes = list_->box[static_cast<std::size_t>(when)];
        for (std::uint32_t r = 0; r < list_->run_count; ++r) {
            if (list_->run[r].object != object) {
                continue;
            }
            for (std::uint32_t k = list_->run[r].begin; k < list_->run[r].end; k += Surroundings::kLanes) {
                std::uint32_t near = Surroundings::meeting(boxes, k, limit);
                for (; near != 0; near &= near - 1) {
                    visit(list_->triangle[k + static_cast<std::size_t>(__builtin_ctz(near))]);
                }
            }
        }
    }

  private:
    friend class Surroundings;
    NearSurfaces(std::span<const MovingSurface> all, const Surroundings::List* list) noexcept
        : all_(all), list_(list) {}

    /// Whether the list has all that may be in the box.
    [[nodiscard]] bool is_listed(const Box& box) const noexcept;

    std::span<const MovingSurface> all_;
    const Surroundings::List* list_ = nullptr;
};

}  // namespace haptic::sim
