// Equilibrium of a tool among surfaces (declared in tool_proxies.hpp).
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <span>

#include "contact/contact_points.hpp"
#include "contact/half_spaces.hpp"
#include "contact/virtual_proxy.hpp"
#include "dynamics/rotation.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

// Solutions after the first in one step; what is left goes on in the next. A flat surface takes two, a curved one more.
constexpr int kMaxRounds = 4;
// rad: a smaller change of the tool's rotation waits for the next step. It changes forces by some 2e-5 of their size.
constexpr double kMinTurn = 1e-5;
// Largest part of a change of the tool's rotation that is taken to remain after it.
constexpr double kMaxRemaining = 0.5;
// Part of the radius: a particle this near to its target is there.
constexpr double kArrived = 1e-4;
// Part of the radius: a particle this near to its anchor has reached it.
constexpr double kReached = 1e-3;
// Normals with a cosine above this are those of the same plane.
constexpr double kSamePlane = 1.0 - 1e-9;
// A force above this multiple of stiffness times largest depth: the surfaces leave a stiff tool no room. The walls of a
// groove press with 1 / (2 sin^2) of half its angle, which reaches this at 0.4 degrees.
constexpr double kNoRoomForce = 1e4;
// Compliance of the surfaces in that case, in units of 1 / stiffness: it bounds the force.
constexpr double kNoRoomCompliance = 1e-3;
// Iterations of extract_rotation() for the tool's rotation, starting at the present one.
constexpr int kTurnIterations = 4;

/// The point nearest to the goal in the intersection of the planes' half-spaces.
Vec3 nearest_in(const SurfacePlanes& planes, const Vec3& goal, double tolerance) {
    std::array<HalfSpace, kMaxSurfacePlanes> half_spaces;
    for (std::size_t k = 0; k < planes.count; ++k) {
        half_spaces[k] = {planes.plane[k].normal, planes.plane[k].offset};
    }
    return project_onto(std::span(half_spaces).first(planes.count), goal, tolerance).point;
}

/// Appends the planes that are not in the list yet, as many as fit. Of parallel planes the foremost stays.
void merge(SurfacePlanes& planes, const SurfacePlanes& others) {
    for (std::size_t k = 0; k < others.count; ++k) {
        const SurfacePlane& plane = others.plane[k];
        const std::span<SurfacePlane> known = std::span(planes.plane).first(planes.count);
        const auto same = std::find_if(known.begin(), known.end(), [&](const SurfacePlane& p) {
            return glm::dot(p.normal, plane.normal) > kSamePlane;
        });
        if (same != known.end()) {
            *same = plane.offset > same->offset ? plane : *same;
        } else if (planes.count < kMaxSurfacePlanes) {
            planes.plane[planes.count++] = plane;
        }
    }
}

}  // namespace

void ToolProxies::find_equilibrium() {
    stopped_ = false;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        // A barrier belongs to the links, not to the sphere: it is not carried on.
        std::fill_n(plane_force_[i].begin(), barrier_rows_[i], 0.0);
        barriers_[i].count = 0;
        barrier_rows_[i] = 0;
    }
    last_change_ = Vec3(0.0);
    // The tool starts in the rotation that the last solution suggests.
    turn_ = fitted_turn_;
    // Independent proxies without friction are in equilibrium where the virtual proxy method leaves them.
    const int max_rounds = elasticity_.independent() && !has_friction() ? 1 : kMaxRounds;
    effort_.rounds = 0;
    set_free_positions();
    carry_sticking();
    for (;; ++effort_.rounds) {
        // Forces for the planes known so far, and where they let the particles be.
        solve_contacts();
        effort_.equilibrium_error = distance_to_targets();
        const double turn = fit_turn();
        // Independent proxies have no rows before they have moved: they always move once.
        const bool agree = effort_.equilibrium_error == 0.0 && turn <= kMinTurn;
        if ((agree && (max_rounds > 1 || effort_.rounds > 0)) || effort_.rounds == max_rounds) {
            break;
        }
        if (elasticity_.independent()) {
            move_apart();
        } else {
            find_planes(move_together());
        }
        if (turn > kMinTurn) {
            turn_ = fitted_turn_;
            set_free_positions();
        }
    }
    // The forces belong to the last targets.
    if (!elasticity_.independent()) {
        (void)move_together();
    }
    store_contacts();
    fit_pose();
}

/// free_i = p + R (o_i + [C Cs (R^T Q - 1) o]_i), and the same in the grip frame.
void ToolProxies::set_free_positions() {
    if (turn_ == Quat(1.0, 0.0, 0.0, 0.0)) {
        for (ToolProxy& p : particles_) {
            p.free_offset = p.rest_offset;
            p.free_position = p.goal;
        }
        return;
    }
    const Mat3 turn = to_matrix(turn_);
    const Mat3 rotation = to_matrix(hip_.orientation);
    elasticity_.follow_springs(glm::transpose(turn) - Mat3(1.0), free_shift_);
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolProxy& p = particles_[i];
        p.free_offset = turn * (p.rest_offset + free_shift_[i]);
        p.free_position = hip_.position + rotation * p.free_offset;
    }
}

/// Fits R to the equilibrium positions. Returns the rotation from the present R, rad.
double ToolProxies::fit_turn() {
    fitted_turn_ = Quat(1.0, 0.0, 0.0, 0.0);
    if (!rows_.empty() && !elasticity_.independent() && !elasticity_.material().limp()) {
        // Shape matching (Müller 2005) of x_i = target_i with the rest shape.
        Vec3 centre(0.0);
        for (const Vec3& x : target_) {
            centre += x / static_cast<double>(target_.size());
        }
        const Mat3 moment = moment_about(centre, [this](std::size_t i) { return target_[i]; });
        const Quat fitted = extract_rotation(moment, elastic_frame(), kTurnIterations);
        fitted_turn_ = glm::normalize(glm::conjugate(hip_.orientation) * fitted);
    }
    // Without it, a part rho of each change would be left for the next fit, nearly the same in all rounds. The secant
    // through the last two fits gives rho; with it, a change goes to where the fits converge.
    const Quat change = glm::conjugate(turn_) * fitted_turn_;
    const Vec3 turn = 2.0 * (change.w < 0.0 ? -1.0 : 1.0) * Vec3(change.x, change.y, change.z);
    const double last = glm::dot(last_change_, last_change_);
    if (last > kMinTurn * kMinTurn) {
        const double left = glm::dot(turn, last_change_) / last;
        remaining_ = std::clamp(1.0 - (1.0 - remaining_) * (1.0 - left), 0.0, kMaxRemaining);
    }
    last_change_ = turn;
    if (rows_.empty()) {
        remaining_ = 0.0;
    } else {
        fitted_turn_ = turned(turn_, to_matrix(turn_) * (turn / (1.0 - remaining_)));
    }
    return glm::length(turn);
}

/// Start of the equilibrium: planes that each particle touches already, and anchors of those that stick.
void ToolProxies::carry_sticking() {
    const bool friction = has_friction();
    const bool proxies_alone = elasticity_.independent() && !friction;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolProxy& p = particles_[i];
        Grip& grip = grips_[i];
        grip = {.anchored = false, .slides = friction && p.friction.slides};
        target_[i] = p.free_position;
        force_[i] = Vec3(0.0);
        // Independent proxies go straight to their goals.
        if (proxies_alone || !p.in_contact()) {
            p.contacts.count = 0;
            p.friction = {};
            continue;
        }
        carry_planes(i);
        if (friction) {
            // The surface takes its anchor along (dt = 1 turns the velocity into a displacement). Without an anchor,
            // because friction has just been switched on or only a barrier held the proxy, it sticks where it is.
            const bool stuck = p.friction.active_planes.count > 0;
            const Vec3 carried = stuck ? p.friction.anchor + carrying_velocity(surfaces_, p.friction, 1.0) : p.position;
            const ProxyMove move = move_proxy(contact_candidates_.of(i), p.position, carried, p.radius, settings_.step,
                                              settings_.contact, path_of(i));
            p.position = move.position;
            // An anchor that it cannot reach is given up.
            const bool reached = glm::length(carried - p.position) < kReached * p.radius;
            grip.anchor = reached ? carried : p.position;
            grip.anchored = true;
        }
        collect_contacts(i, {});
    }
}

/// Moves the planes of the last step with their surfaces. Those that pressed start in the contact problem, even if
/// their surface has yielded: the tool then sets out for its new equilibrium, not for the goals behind the surface.
void ToolProxies::carry_planes(std::size_t particle) {
    SurfacePlanes& contacts = particles_[particle].contacts;
    if (elasticity_.independent()) {
        contacts.count = 0;
    }
    for (std::uint32_t c = 0; c < contacts.count; ++c) {
        SurfacePlane& plane = contacts.plane[c];
        const SurfacePoint& touched = plane.touched;
        const SurfaceMotion& motion = surfaces_[touched.object].motion;
        plane.offset += glm::dot(plane.normal, displacement_of(motion, touched.triangle, touched.weights));
        // Where surfaces close in, the sphere has less room than before: the plane does not push it back.
        plane.offset = std::min(plane.offset, glm::dot(plane.normal, particles_[particle].position));
    }
}

/// The planes that press on the particle in the present solution, at the points of their triangles that are nearest to
/// its new position. A plane that presses stays in the problem although the particle has left the surface: over an edge
/// the rounds would alternate between its sides.
SurfacePlanes ToolProxies::pressing_planes(std::size_t particle) const {
    const ToolProxy& p = particles_[particle];
    SurfacePlanes pressing;
    for (std::size_t c = barrier_rows_[particle]; c < p.contacts.count; ++c) {
        if (!(plane_force_[particle][c] > 0.0)) {
            continue;
        }
        // The sphere's distance from the triangle, linearised at its position.
        SurfacePlane plane = p.contacts.plane[c];
        SurfacePoint& touched = plane.touched;
        const SurfaceMotion& motion = surfaces_[touched.object].motion;
        const TriangleCorners corners = corners_of(motion, touched.triangle, 1.0);
        const double height = plane.offset - glm::dot(plane.normal, blend(corners, touched.weights));
        const ClosestPoint nearest = closest_point_on_triangle(p.position, corners);
        const double distance = std::sqrt(nearest.squared_distance);
        if (distance > 0.0) {
            touched.feature = nearest.feature;
            touched.weights = nearest.weights;
            plane.normal = (p.position - nearest.point) / distance;
            plane.offset = glm::dot(plane.normal, nearest.point) + height;
            plane.velocity =
                glm::dot(plane.normal, displacement_of(motion, touched.triangle, touched.weights)) / settings_.step;
            pressing.plane[pressing.count++] = plane;
        }
    }
    return pressing;
}

/// Planes that hold the particle back from its unloaded position: where it would be without its own contact forces.
void ToolProxies::collect_contacts(std::size_t particle, const SurfacePlanes& stopped_by) {
    ToolProxy& p = particles_[particle];
    const Vec3& force = force_[particle];
    const SurfacePlanes pressing = pressing_planes(particle);
    p.contacts = barriers_[particle];
    if (force == Vec3(0.0) && stopped_by.count > 0) {
        merge(p.contacts, stopped_by);
    } else {
        const Vec3 unloaded = target_[particle] - compliance(particle, particle) * force;
        ActiveContacts active;
        active.update(contact_candidates_.of(particle), p.position, unloaded, p.radius, settings_.contact);
        merge(p.contacts, stopped_by);
        merge(p.contacts, active.planes(contact_candidates_.of(particle), settings_.step));
        merge(p.contacts, pressing);
    }
    stopped_ = stopped_ || p.in_contact();
    if (!p.in_contact()) {
        grips_[particle].anchored = false;
        grips_[particle].slides = false;
    }
}

void ToolProxies::solve_contacts() {
    write_rows();
    solve_rows();
    set_targets();
}

/// Rows of the contact problem at the present planes: directions, depths, and W_rs = d_r . C_ij d_s in the tool's
/// frame.
void ToolProxies::write_rows() {
    rows_.clear();
    friction_rows_.clear();
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        barrier_rows_[i] = barriers_[i].count;
        const ToolProxy& p = particles_[i];
        if (!p.in_contact()) {
            continue;
        }
        const auto proxy = static_cast<std::uint32_t>(i);
        const auto first = static_cast<std::uint16_t>(rows_.size());
        // Normal rows: depth of the free position behind the plane.
        for (std::uint32_t c = 0; c < p.contacts.count; ++c) {
            const SurfacePlane& plane = p.contacts.plane[c];
            rows_.push_back({.proxy = proxy,
                             .plane = c,
                             .direction = plane.normal,
                             .depth = plane.offset - glm::dot(plane.normal, p.free_position)});
        }
        // Tangential rows: distance from the free position to the anchor, which rolls as the hip turns the sphere.
        const Grip& grip = grips_[i];
        if (!grip.anchored) {
            continue;
        }
        const Vec3 arm = friction_arm(p);
        const Vec3 anchor = grip.anchor - rolled(hip_.orientation, arm);
        const std::array<Vec3, 2> tangents = contact_tangents(p.contacts.plane[0].normal);
        for (std::uint32_t t = 0; t < 2; ++t) {
            rows_.push_back({.proxy = proxy,
                             .plane = t,
                             .tangential = true,
                             .direction = tangents[t],
                             .arm = arm,
                             .depth = glm::dot(tangents[t], anchor - p.free_position)});
        }
        friction_rows_.push_back(
            {.first_normal = first,
             .normals = static_cast<std::uint16_t>(p.contacts.count),
             .coefficient = grip.slides ? settings_.contact.dynamic_friction : settings_.contact.static_friction});
    }
    std::array<ToolElasticity::Push, kMaxContactRows> pushes;  // NOLINT(*-member-init): filled below
    row_compliance_.resize(rows_.size());
    for (std::size_t s = 0; s < rows_.size(); ++s) {
        row_depth_[s] = rows_[s].depth;
        pushes[s] = push(rows_[s].proxy, rows_[s].direction, rows_[s].arm);
        // What a proxy feels of a row is shared by its rows.
        const Vec3 turn = elasticity_.turn(pushes[s]);
        std::uint32_t proxy = rows_[s].proxy;
        Vec3 column = elasticity_.displacement(proxy, pushes[s]);
        for (std::size_t r = s + 1; r-- > 0;) {
            if (rows_[r].proxy != proxy) {
                proxy = rows_[r].proxy;
                column = elasticity_.displacement(proxy, pushes[s]);
            }
            row_compliance_.set(r, s, glm::dot(pushes[r].direction, column) + glm::dot(pushes[r].moment, turn));
        }
    }
}

/// m: how far an arm turns with a sphere from the end of the last step until it is turned like `frame`.
Vec3 ToolProxies::rolled(const Quat& frame, const Vec3& arm) const noexcept {
    return frame * (glm::conjugate(last_frame_) * arm) - arm;
}

Vec3 ToolProxies::place_of(const SurfacePoint& point) const noexcept {
    return blend(corners_of(surfaces_[point.object].motion, point.triangle, 1.0), point.weights);
}

Vec3 ToolProxies::unturned_position(const ToolProxy& proxy) const noexcept {
    return proxy.sticks() ? proxy.position - rolled(hip_.orientation, friction_arm(proxy)) : proxy.position;
}

void ToolProxies::solve_rows() {
    if (rows_.empty()) {
        return;
    }
    const std::span<const double> depth(row_depth_.data(), rows_.size());
    const auto solve = [&] { (void)contact_solver_.solve(row_compliance_, depth, friction_rows_); };
    solve();
    // Static friction gives way to dynamic friction once it is exceeded.
    const auto begins_to_slide = [&](const FrictionRows& rows) {
        const Grip& grip = grips_[rows_[rows.first_normal].proxy];
        return rows.slides && !grip.slides;
    };
    if (settings_.contact.dynamic_friction < settings_.contact.static_friction &&
        std::any_of(friction_rows_.begin(), friction_rows_.end(), begins_to_slide)) {
        for (FrictionRows& rows : friction_rows_) {
            Grip& grip = grips_[rows_[rows.first_normal].proxy];
            grip.slides = grip.slides || rows.slides;
            rows.coefficient = grip.slides ? settings_.contact.dynamic_friction : settings_.contact.static_friction;
        }
        solve();
    }
    // Surfaces that leave a stiff tool no room would press without limit: they give way a little. A single proxy has
    // room, because its planes are those of the largest radius that fits.
    const double stiffness = std::max(elasticity_.springs().stiffness, ToolElasticity::kMinStiffness);
    double deepest = 0.0;
    double strongest = 0.0;
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        if (!rows_[r].tangential) {
            deepest = std::max(deepest, depth[r]);
            strongest = std::max(strongest, contact_solver_.force()[r]);
        }
    }
    if (!elasticity_.independent() && deepest > 0.0 && strongest > kNoRoomForce * stiffness * deepest) {
        for (std::size_t r = 0; r < rows_.size(); ++r) {
            if (!rows_[r].tangential) {
                row_compliance_.set(r, r, row_compliance_(r, r) + kNoRoomCompliance / stiffness);
            }
        }
        solve();
    }
    for (const FrictionRows& rows : friction_rows_) {
        for (std::size_t r = rows.first_normal; r < std::size_t{rows.first_normal} + rows.normals + 2; ++r) {
            rows_[r].slides = rows.slides;
        }
    }
}

/// x_i = free_i + R sum_j C_ij R^T f_j, and the rotation by moments on the spheres.
void ToolProxies::set_targets() {
    std::fill(force_.begin(), force_.end(), Vec3(0.0));
    Vec3 moment(0.0);
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        rows_[r].force = contact_solver_.force()[r];
        if (!rows_[r].tangential) {
            plane_force_[rows_[r].proxy][rows_[r].plane] = rows_[r].force;
        }
        force_[rows_[r].proxy] += rows_[r].force * rows_[r].direction;
        moment += glm::cross(rows_[r].arm, rows_[r].force * rows_[r].direction);
    }
    const Mat3 rotation = to_matrix(elastic_frame());
    const Mat3 to_tool = glm::transpose(rotation);
    // Displacements in the tool's frame: few particles feel a force.
    const Vec3 turn = elasticity_.turn_compliance() * (to_tool * moment);
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        displacement_[i] = elasticity_.turned(i, turn);
    }
    for (std::size_t j = 0; j < particles_.size(); ++j) {
        if (force_[j] == Vec3(0.0)) {
            continue;
        }
        const Vec3 force = to_tool * force_[j];
        for (std::size_t i = 0; i < particles_.size(); ++i) {
            // C_ij = C_ji^T: column j of C lies in memory as row j.
            displacement_[i] += force * elasticity_.compliance(j, i);
        }
    }
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        target_[i] = particles_[i].free_position;
        if (displacement_[i] != Vec3(0.0)) {
            target_[i] += rotation * displacement_[i];
        }
    }
}

/// m: largest distance of a particle that is not at its target, to kArrived; 0 if all are.
double ToolProxies::distance_to_targets() {
    double largest = 0.0;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        const double distance = glm::length(target_[i] - particles_[i].position);
        if (distance > kArrived * particles_[i].radius) {
            largest = std::max(largest, distance);
        }
    }
    return largest;
}

/// Independent particles: each goes to its own target.
void ToolProxies::move_apart() {
    record_starts();
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        move_toward(i, target_[i]);
    }
    // Links can only cross a surface if a particle met one.
    if (stopped_) {
        restore_crossing_links();
    }
}

/// Moves all particles by the same fraction of their ways to the targets, up to the first contact (Ortega, Redon,
/// Coquillart 2007), and returns it. The tool passes through shapes between the present one and its equilibrium, so
/// that surfaces do not tear it apart.
double ToolProxies::move_together() {
    record_starts();
    // Fraction of its own way up to the first contact of each particle.
    double fraction = 1.0;
    const double shrink = settings_.contact.shrink;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        const ToolProxy& p = particles_[i];
        const NearSurfaces near = contact_candidates_.of(i);
        const double reach = contact_reach(p.radius, settings_.contact);
        free_way_[i] = near.is_clear(aabb_of_segment(p.position, target_[i], reach))
                           ? 1.0
                           : free_fraction(near, p.position, target_[i] - p.position, p.radius * shrink, shrink);
        fraction = std::min(fraction, free_way_[i]);
    }
    stopped_ = stopped_ || fraction < 1.0;
    // The common move.
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolProxy& p = particles_[i];
        p.position = fraction == 1.0 ? target_[i] : p.position + fraction * (target_[i] - p.position);
        if (ProxyPath* const path = path_of(i)) {
            path->append(1.0, p.position);
        }
    }
    // If a surface would pass between two particles, the tool stays. Links can only cross if a particle met a surface.
    return stopped_ && restore_if_link_crosses() ? 0.0 : fraction;
}

/// Planes for the next solution after a common move by `fraction`: those at the particles' positions, and those that
/// will stop a particle farther on its way to the target.
void ToolProxies::find_planes(double fraction) {
    const bool friction = has_friction();
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolProxy& p = particles_[i];
        Grip& grip = grips_[i];
        const NearSurfaces near = contact_candidates_.of(i);
        const bool blocked = free_way_[i] < 1.0;
        const double reach = contact_reach(p.radius, settings_.contact);
        if (!blocked && barriers_[i].count == 0 && near.is_far(aabb_of_segment(p.position, p.position, reach))) {
            p.contacts.count = 0;
            grip.anchored = grip.slides = false;
            continue;
        }
        // Where the particle would stop on its own.
        Vec3 stop = p.position;
        SurfacePlanes ahead;
        if (blocked) {
            const double left = fraction < 1.0 ? (free_way_[i] - fraction) / (1.0 - fraction) : 0.0;
            stop += left * (target_[i] - p.position);
            ActiveContacts active;
            active.update(near, stop, target_[i], p.radius, settings_.contact);
            ahead = active.planes(near, settings_.step);
        }
        collect_contacts(i, ahead);
        // With friction it sticks where it first touches.
        if (friction && p.in_contact() && !grip.anchored) {
            grip.anchored = true;
            grip.anchor = stop;
        }
    }
}

/// Traditional proxy method (Ruspini 1997) toward the target, then the planes for the next solution. With friction, a
/// particle that has not touched anything stops where it first does: its anchor.
void ToolProxies::move_toward(std::size_t particle, const Vec3& target) {
    ToolProxy& p = particles_[particle];
    Grip& grip = grips_[particle];
    const NearSurfaces near = contact_candidates_.of(particle);
    Vec3 aim = target;
    if (has_friction() && !grip.anchored) {
        const Vec3 displacement = target - p.position;
        const double shrink = settings_.contact.shrink;
        const double free = free_fraction(near, p.position, displacement, p.radius * shrink, shrink);
        grip.anchored = free < 1.0;
        aim = grip.anchored ? p.position + free * displacement : target;
    }
    const ProxyMove move =
        move_proxy(near, p.position, aim, p.radius, settings_.step, settings_.contact, path_of(particle));
    p.position = move.position;
    if (grip.anchored && aim != target) {
        grip.anchor = p.position;
    }
    stopped_ = stopped_ || move.contacts.count > 0 || move.iterations > 1 || !move.converged;
    // Without force and obstacle there is nothing to look for.
    if (move.contacts.count > 0 || grip.anchored || force_[particle] != Vec3(0.0) || barriers_[particle].count > 0) {
        collect_contacts(particle, move.contacts);
    } else {
        p.contacts.count = 0;
    }
}

/// Results of the step: planes that press, friction, and the nearest allowed point to the goal.
void ToolProxies::store_contacts() {
    // A particle on which no surface presses is not in contact.
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolProxy& p = particles_[i];
        p.friction = {};
        if (force_[i] == Vec3(0.0)) {
            p.contacts.count = 0;
        }
    }
    std::erase_if(rows_, [&](const ContactRow& row) { return !particles_[row.proxy].in_contact(); });
    // Shares of the planes in each particle's normal force.
    for (const ContactRow& row : rows_) {
        if (!row.tangential) {
            particles_[row.proxy].friction.share[row.plane] = row.force;
        }
    }
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolProxy& p = particles_[i];
        FrictionState& friction = p.friction;
        double sum = 0.0;
        for (std::size_t c = 0; c < p.contacts.count; ++c) {
            sum += friction.share[c];
        }
        for (std::size_t c = 0; c < p.contacts.count; ++c) {
            friction.share[c] = sum > 0.0 ? friction.share[c] / sum : 1.0 / p.contacts.count;
        }
        if (grips_[i].anchored && p.in_contact()) {
            friction.active_planes = p.contacts;
            friction.anchor = grips_[i].anchor - rolled(elastic_frame(), friction_arm(p));
        }
        p.constrained_goal = nearest_in(p.contacts, p.goal, kArrived * p.radius);
    }
    last_frame_ = elastic_frame();
    for (const ContactRow& row : rows_) {
        // A sliding proxy takes its anchor along; that of a sticking one stays, so that it does not creep.
        ToolProxy& p = particles_[row.proxy];
        p.friction.slides = row.slides;
        p.friction.anchor = row.slides ? p.position : p.friction.anchor;
    }
}

}  // namespace haptic::sim
