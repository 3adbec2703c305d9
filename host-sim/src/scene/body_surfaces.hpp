// The surfaces of all bodies over a step.
//
// Each follows the skin of its body as soon as that has arrived. Then those of solids are kept apart
// (collision/solid_surfaces.hpp); what is too far behind waits (waiting_bodies.hpp), and what is entangled with nothing
// but one another comes free (lone_surfaces.hpp). Where nothing else helps, bodies stand still, as if the step had not
// moved them: for one another, and before the next step for the tool. Then so do all that they may have met.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "collision/solid_surfaces.hpp"
#include "contact/swept_tree.hpp"
#include "dynamics/rigid_motion.hpp"
#include "dynamics/stage_clock.hpp"
#include "dynamics/workers.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/skin.hpp"
#include "haptic/types.hpp"
#include "scene/assembly.hpp"
#include "scene/lone_surfaces.hpp"
#include "scene/sleeping_bodies.hpp"
#include "scene/waiting_bodies.hpp"
#include "simd/aabb.hpp"
#include "simd/collider_rows.hpp"

namespace haptic::sim {

class BodySurfaces {
  public:
    /// Arguments outlive it. `sheet`: per body, whether it is a sheet that collides. Surfaces begin where they are at
    /// rest, above the ground, and trees are fitted to them.
    BodySurfaces(const Scene& scene, Assembly& assembly, std::span<const std::uint8_t> sheet, SleepingBodies& sleeping,
                 Workers& workers, StageClock::Function clock);
    // Its parts refer to one another.
    BodySurfaces(const BodySurfaces&) = delete;
    BodySurfaces& operator=(const BodySurfaces&) = delete;

    /// Before a step, once it is known who sleeps.
    void begin_step();
    /// A body has arrived: its surface moves to its skin, and its tree is fitted. Different bodies on any thread.
    void move(std::size_t body) noexcept;
    /// After the step: takes back what would lead a surface through another one.
    void keep_apart(const LoneTool& tool);

    /// Whether some bodies stand still.
    [[nodiscard]] bool some_stand() const noexcept { return std::ranges::find(stands_, 1) != stands_.end(); }
    /// None stands still any more, until some have to for the tool.
    void let_none_stand() noexcept { std::ranges::fill(stands_, std::uint8_t{0}); }
    /// Lets these bodies stand still, or all if none of them is left to, as if the last step had not moved them. Adds
    /// the momentum that they lose, kg m/s. False: all did already.
    [[nodiscard]] bool let_stand(std::span<const std::uint32_t> bodies, Vec3& lost);

    /// Whether the state of a body is no longer finite, or it is 1e8 m away.
    [[nodiscard]] bool diverged() const noexcept { return diverged_; }
    /// Vertices of all before and after the last step, m. They stay where they are in memory.
    [[nodiscard]] const std::vector<Vec3>& start() const noexcept { return start_; }
    [[nodiscard]] const std::vector<Vec3>& end() const noexcept { return end_; }
    /// Per body, in the last step; they point at these.
    [[nodiscard]] std::span<const MovingSurface> moving() const noexcept { return moving_; }
    [[nodiscard]] const SolidSurfaces& solids() const noexcept { return *solids_; }

    /// ns, since the last call, of the thread that calls it.
    struct Times {
        std::int64_t skin_ns;
        std::int64_t refit_ns;
        std::int64_t apart_ns;
    };
    [[nodiscard]] Times take_times() noexcept {
        return {.skin_ns = skin_clock_.take(), .refit_ns = refit_clock_.take(), .apart_ns = apart_clock_.take()};
    }

  private:
    void write_skin(std::size_t body, std::span<Vec3> to, std::span<Vec3> before = {});
    void take_boxes();
    void put_back(Vec3& lost);
    void let_neighbours_stand();
    void return_body(std::size_t body, Vec3& lost);
    void carry_surfaces();
    [[nodiscard]] bool follows(std::size_t body) const;
    void let_bodies_wait(const LoneTool& tool);
    [[nodiscard]] bool let_left_behind_stand();
    [[nodiscard]] bool let_sheets_stand();
    void let_lone_surfaces_jump(const LoneTool& tool);
    void take_rooms();

    const Scene& scene_;
    Assembly& assembly_;
    std::span<const std::uint8_t> sheet_;
    SleepingBodies& sleeping_;
    Workers& workers_;
    StageClock skin_clock_;
    StageClock refit_clock_;
    StageClock apart_clock_;
    Skinner skinner_;
    std::vector<Vec3> start_;
    std::vector<Vec3> end_;
    std::vector<MovingSurface> moving_;
    std::vector<int> unmoved_skins_;  // per body: consecutive steps without motion, up to kFittedAfter
    std::atomic<bool> diverged_ = false;
    std::unique_ptr<SolidSurfaces> solids_;  // of all bodies
    // Bodies that stand still; where all were before the last step, and in which boxes in it, if nothing had stood.
    std::vector<std::uint8_t> stands_;
    ParticlePlaces were_at_;
    std::vector<Bounds> were_in_;
    // Bodies that wait: who may, the motions of their groups, and who makes which.
    WaitingBodies waiting_;
    std::vector<std::uint8_t> may_wait_;
    std::vector<RigidMotion> motions_;
    std::vector<std::uint32_t> carried_by_;
    // Surfaces that go to their skins at once: whether that is to be tested, and who does.
    LoneSurfaces lone_;
    std::vector<std::uint8_t> is_due_;
    std::vector<std::uint8_t> jumps_;
    std::vector<Vec3> skins_;  // m, where skins are that somebody asks for, beside surfaces that stay
};

}  // namespace haptic::sim
