#include "scene/body_surfaces.hpp"

#include <cmath>
#include <glm/common.hpp>
#include <utility>

#include "collision/body_sweep.hpp"
#include "haptic/sim/particles.hpp"
#include "scene/scene_collisions.hpp"
#include "scene/spread.hpp"

namespace haptic::sim {
namespace {

// Of the mean edge of a surface: how far it may lag behind its skin. A fish in a hand that closes firmly round it lags
// by up to three. The farther it may be, the less often it finds its way back.
constexpr double kFarthestLag = 4.0;
// Of heights above the lowest vertex: what is left of them where a surface is led above the ground.
constexpr double kFlattened = 1.0 / 64.0;
// Steps without motion after which a body is neither skinned nor refitted. After two, both ends of the step have the
// same vertices and the tree has been fitted to them.
constexpr int kFittedAfter = 2;
// m: farther away a state has diverged. Rounding there is a few times 1e-8 m, as wide as gaps between surfaces.
constexpr double kFarthest = 1e8;
// Of attempts to find those of a group that may jump: each looks for crossings of all surfaces.
constexpr int kRoundsOfJumps = 3;

/// Whether the state of some particles is finite, and they are where a simulation means something.
bool is_usable(const ParticleModel& model, const Skinner::Part& part) noexcept {
    bool is_far = false;
    for (std::size_t i = part.first_particle; i < part.first_particle + part.particles; ++i) {
        const Vec3 far = glm::abs(model.position[i]);
        is_far |= !(std::max({far.x, far.y, far.z}) <= kFarthest);
    }
    return !is_far && is_finite(model, part.first_particle, part.particles);
}

/// Leads a surface that reaches below the floor above it, y <- max(y, floor + (y - lowest) / 64): continuous and
/// increasing, so that no vertices change their order in height. The lowest is on the floor then.
void flatten(std::span<Vec3> surface, double floor) noexcept {
    if (std::isinf(floor)) {
        return;
    }
    const auto lower = [](const Vec3& a, const Vec3& b) { return a.y < b.y; };
    const auto lowest = std::ranges::min_element(surface, lower);
    if (lowest == surface.end() || lowest->y >= floor) {
        return;
    }
    const double bottom = lowest->y;
    for (Vec3& vertex : surface) {
        vertex.y = std::max(vertex.y, floor + kFlattened * (vertex.y - bottom));
    }
}

}  // namespace

BodySurfaces::BodySurfaces(const Scene& scene, Assembly& assembly, std::span<const std::uint8_t> sheet,
                           SleepingBodies& sleeping, Workers& workers, StageClock::Function clock)
    : scene_(scene),
      assembly_(assembly),
      sheet_(sheet),
      sleeping_(sleeping),
      workers_(workers),
      skin_clock_(clock),
      refit_clock_(clock),
      apart_clock_(clock),
      skinner_(assembly.mesh.vertices, assembly.model, assembly.skin),
      start_(assembly.mesh.vertices),
      end_(assembly.mesh.vertices),
      unmoved_skins_(assembly.bodies.size(), 0),
      stands_(assembly.bodies.size(), 0),
      were_at_(assembly.model),
      were_in_(assembly.bodies.size()),
      waiting_(assembly, kFarthestLag),
      may_wait_(assembly.bodies.size(), 0),
      motions_(assembly.bodies.size()),
      carried_by_(assembly.bodies.size(), SolidSurfaces::kFollows),
      lone_(assembly),
      is_due_(assembly.bodies.size(), 0),
      jumps_(assembly.bodies.size(), 0),
      skins_(assembly.mesh.vertices.size()) {
    for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
        const std::span<Vec3> start = assembly.surface_of(b, std::span(start_));
        const std::span<Vec3> end = assembly.surface_of(b, std::span(end_));
        flatten(end, assembly.floor[b]);
        std::ranges::copy(end, start.begin());
        const SurfaceMotion motion{start, end, assembly.bodies[b].mesh.triangles};
        assembly.trees[b].refit(motion);
        moving_.push_back({motion, &assembly.trees[b]});
    }
    solids_ = make_solid_surfaces(assembly, scene.collisions, start_);
}

void BodySurfaces::begin_step() {
    solids_->let_sleep(sleeping_.asleep());
    were_at_.take(assembly_.model);
    waiting_.begin_step(solids_->most_lag());
}

bool BodySurfaces::let_stand(std::span<const std::uint32_t> bodies, Vec3& lost) {
    if (std::ranges::find(stands_, 0) == stands_.end()) {
        return false;
    }
    bool more = false;
    for (const std::uint32_t body : bodies) {
        more = std::exchange(stands_[body], std::uint8_t{1}) == 0 || more;
    }
    if (!more) {
        std::ranges::fill(stands_, std::uint8_t{1});
    }
    take_boxes();
    put_back(lost);
    return true;
}

/// Puts bodies back that stand still, and all that they may have met. Adds the momentum that they lose, kg m/s.
void BodySurfaces::put_back(Vec3& lost) {
    do {
        let_neighbours_stand();
        for (std::size_t b = 0; b < stands_.size(); ++b) {
            if (stands_[b] != 0) {
                return_body(b, lost);
            }
        }
        // Surfaces of others follow as far as those that stand let them.
        carry_surfaces();
    } while (let_sheets_stand());
}

void BodySurfaces::take_boxes() {
    for (std::size_t b = 0; b < were_in_.size(); ++b) {
        were_in_[b] = bounds_of(assembly_.trees[b].bounds());
    }
}

/// With a body all others stand that can move and that it may have met in the last step: so nothing has crossed, and
/// none is on the wrong side of another.
void BodySurfaces::let_neighbours_stand() {
    const auto meet = [&](std::size_t a, std::size_t b) {
        return ((sheet_[a] & sheet_[b]) != 0 || scene_.collisions.between_bodies) && assembly_.is_movable(a) &&
               assembly_.is_movable(b) && overlap(were_in_[a], were_in_[b]);
    };
    spread(
        stands_.size(), [&](std::size_t b) { return stands_[b] != 0; }, meet, [&](std::size_t b) { stands_[b] = 1; });
}

/// Puts a body back where it was before the last step, at rest; what a script leads goes on, but in a sheet. What stops
/// it takes its momentum.
void BodySurfaces::return_body(std::size_t body, Vec3& lost) {
    const Skinner::Part part = assembly_.part(body);
    ParticleModel& model = assembly_.model;
    for (std::size_t i = part.first_particle; i < part.first_particle + part.particles; ++i) {
        if (model.pinned[i] == 0 || sheet_[body] != 0) {
            model.position[i] = were_at_.position[i];
            model.orientation[i] = were_at_.orientation[i];
        }
        if (model.pinned[i] == 0) {
            lost += model.mass[i] * std::exchange(model.velocity[i], Vec3(0.0));
            model.angular_velocity[i] = Vec3(0.0);
        }
    }
    // The surface of a solid may have lagged behind its skin then, and lags again.
    write_skin(body, end_);
    solids_->forget_lag(body);
    sleeping_.disturb(body);
}

/// Writes where the skin of a body is, above the ground. `before` gets what was there, unless it is empty.
void BodySurfaces::write_skin(std::size_t body, std::span<Vec3> to, std::span<Vec3> before) {
    skinner_.skin_vertices(assembly_.model, assembly_.part(body), to, before);
    flatten(assembly_.surface_of(body, to), assembly_.floor[body]);
}

void BodySurfaces::move(std::size_t body) noexcept {
    const Skinner::Part part = assembly_.part(body);
    {
        const StageClock::Span timed(skin_clock_);
        if (!is_usable(assembly_.model, part)) {
            diverged_ = true;
            return;
        }
        // The end of the last step is the start of this one, for bodies that did not move too, once. The end stays
        // where it is in memory, for those who look at it.
        const bool is_awake = sleeping_.asleep()[body] == 0;
        if (is_awake && waiting_.share(body) < 1.0) {
            waiting_.slow(body, were_at_, scene_.solver.step, assembly_);
        }
        const bool moved = is_awake && (solids_->lags(body) || skinner_.has_moved(assembly_.model, part));
        if (moved) {
            write_skin(body, end_, start_);
            solids_->ask(body, end_, waiting_.share(body) * scene_.solver.step);
        } else if (unmoved_skins_[body] < kFittedAfter) {
            const auto first = static_cast<std::ptrdiff_t>(part.first_vertex);
            std::copy_n(end_.begin() + first, part.vertices, start_.begin() + first);
        }
        unmoved_skins_[body] = moved ? 0 : std::min(unmoved_skins_[body] + 1, kFittedAfter);
    }
    const StageClock::Span timed(refit_clock_);
    if (unmoved_skins_[body] < kFittedAfter) {
        assembly_.trees[body].refit(moving_[body].motion);
    }
}

void BodySurfaces::keep_apart(const LoneTool& tool) {
    std::ranges::fill(stands_, std::uint8_t{0});
    if (diverged_ || !solids_->may_hold_back()) {
        return;
    }
    const StageClock::Span timed(apart_clock_);
    take_boxes();
    solids_->keep_apart(start_, end_, workers_);
    // The surface of a sheet is where its particles are. What it and the others lose no one takes.
    if (let_sheets_stand()) {
        Vec3 lost(0.0);
        put_back(lost);
    }
    let_bodies_wait(tool);
    let_lone_surfaces_jump(tool);
}

/// Lets solids wait for their surfaces, in groups, and where there is no room for that, stand still.
void BodySurfaces::let_bodies_wait(const LoneTool& tool) {
    bool some_are_excused = false;
    for (std::size_t b = 0; b < stands_.size(); ++b) {
        may_wait_[b] = follows(b) ? 1 : 0;
        some_are_excused = some_are_excused || (follows(b) && lone_.need_not_wait(b));
        if (waiting_.share(b) < 1.0) {
            sleeping_.disturb(b);  // it is slow, but not at rest
        }
    }
    if (some_are_excused) {
        take_rooms();
        for (std::size_t b = 0; b < stands_.size(); ++b) {
            if (lone_.need_not_wait(b) && lone_.is_alone(b, tool)) {
                may_wait_[b] = 0;
            }
        }
    }
    const std::span<const Bounds> none;
    if (!waiting_.find(solids_->most_lag(), may_wait_, scene_.collisions.between_bodies ? were_in_ : none)) {
        return;
    }
    // Each group goes as a whole, and its surfaces with it.
    const std::span<const std::uint32_t> group_of = waiting_.group_of();
    const WaitingBodies::Surroundings around{
        .step = scene_.solver.step, .vertices = start_, .friction = scene_.collisions.dynamic_friction};
    for (std::uint32_t b = 0; b < stands_.size(); ++b) {
        if (group_of[b] == b) {
            motions_[b] = waiting_.let_wait(b, were_at_, around, assembly_);
        }
    }
    for (std::size_t b = 0; b < stands_.size(); ++b) {
        if (group_of[b] != WaitingBodies::kNone) {
            write_skin(b, end_);
            unmoved_skins_[b] = 0;
            solids_->forget_lag(b);
        }
    }
    carry_surfaces();
    // Sheets first: put_back() forgets which of them had to stand.
    while (let_sheets_stand() || let_left_behind_stand()) {
        Vec3 lost(0.0);  // no one takes it
        put_back(lost);
    }
}

/// Surfaces of bodies that stand do too, those of groups that wait go as a whole, and others follow.
void BodySurfaces::carry_surfaces() {
    for (std::size_t b = 0; b < stands_.size(); ++b) {
        const std::uint32_t group = waiting_.group_of()[b];
        const std::uint32_t others = group == WaitingBodies::kNone ? SolidSurfaces::kFollows : group;
        carried_by_[b] = stands_[b] != 0 ? SolidSurfaces::kStands : others;
    }
    solids_->carry(carried_by_, motions_, start_, end_, workers_);
}

/// Lets surfaces that are entangled with nothing but one another go where their skins are: one group in a step.
void BodySurfaces::let_lone_surfaces_jump(const LoneTool& tool) {
    for (std::size_t b = 0; b < stands_.size(); ++b) {
        const double lag = solids_->most_lag()[b];
        is_due_[b] = follows(b) && lone_.end_step(b, lag, scene_.solver.step) ? 1 : 0;
    }
    const auto first = static_cast<std::size_t>(std::ranges::find(is_due_, 1) - is_due_.begin());
    if (first == is_due_.size()) {
        return;
    }
    take_rooms();
    const bool alone = lone_.is_alone(first, tool);
    const std::span<const std::uint8_t> group = lone_.group();
    for (std::size_t b = 0; b < stands_.size(); ++b) {
        if ((group[b] & is_due_[b]) != 0) {
            lone_.begin_test(b, alone);
        }
        jumps_[b] = group[b] != 0 && follows(b) && solids_->lags(b) ? 1 : 0;
    }
    if (!alone) {
        return;
    }
    bool all_may = false;
    for (int round = 0; round < kRoundsOfJumps && !all_may; ++round) {
        std::ranges::copy(end_, skins_.begin());
        for (std::size_t b = 0; b < stands_.size(); ++b) {
            if (jumps_[b] != 0) {
                solids_->write_skin(b, end_, skins_);
                lone_.draw_in(b, solids_->most_lag()[b], skins_);
                flatten(assembly_.surface_of(b, std::span(skins_)), assembly_.floor[b]);
            }
        }
        all_may = lone_.may_jump(jumps_, start_, skins_);
    }
    if (!all_may || std::ranges::find(jumps_, 1) == jumps_.end()) {
        return;
    }
    // The step ends here for the others of the group too: it must not be undone any more.
    for (std::size_t b = 0; b < stands_.size(); ++b) {
        if (group[b] != 0 && sleeping_.asleep()[b] == 0) {
            solids_->jump(b, skins_, start_, end_);
            waiting_.let_go(b);
            unmoved_skins_[b] = 0;
        }
        if (jumps_[b] != 0) {
            lone_.note_jump(b);
        }
    }
}

/// Takes boxes around the surfaces over this step, which the tool does not know yet, and around their skins.
void BodySurfaces::take_rooms() {
    for (std::size_t b = 0; b < stands_.size(); ++b) {
        Aabb& room = lone_.rooms()[b];
        room = assembly_.trees[b].bounds();
        if (solids_->lags(b)) {
            solids_->write_skin(b, end_, skins_);
            room.extend(aabb_of(assembly_.surface_of(b, std::span<const Vec3>(skins_))));
        }
    }
}

/// Whether a body is a solid whose surface is kept from itself and has followed its motion in this step.
bool BodySurfaces::follows(std::size_t body) const {
    return solids_->keeps_whole(static_cast<std::uint32_t>(body)) && stands_[body] == 0 &&
           sleeping_.asleep()[body] == 0;
}

/// Whether there are solids whose surfaces are still too far behind. They stand still from now on.
bool BodySurfaces::let_left_behind_stand() {
    bool more = false;
    for (std::size_t b = 0; b < stands_.size(); ++b) {
        // What has gone as a whole lags as before, but for what the ground has flattened of its skin.
        const bool has_waited = waiting_.group_of()[b] != WaitingBodies::kNone && !solids_->stands(b);
        if (may_wait_[b] != 0 && stands_[b] == 0 && !has_waited && waiting_.is_to_wait(b, solids_->most_lag()[b])) {
            stands_[b] = 1;
            more = true;
        }
    }
    return more;
}

/// Lets sheets stand still whose surfaces had to, because a solid has no room to follow them. Whether there are more.
bool BodySurfaces::let_sheets_stand() {
    bool more = false;
    for (std::size_t b = 0; b < stands_.size(); ++b) {
        if (sheet_[b] != 0 && solids_->is_carried(b)) {
            more = std::exchange(stands_[b], std::uint8_t{1}) == 0 || more;
        }
    }
    return more;
}

}  // namespace haptic::sim
