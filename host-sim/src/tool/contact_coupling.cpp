#include "tool/contact_coupling.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numeric>
#include <ranges>
#include <utility>

#include "dynamics/rotation.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {
namespace {

// Largest payment of what is owed, in contact forces.
constexpr double kMaxPayment = 10.0;
// A motion of the whole tool counts as one of these rows if the others leave this part of it.
constexpr double kMinMotion = 1e-6;
// Friction coefficient that never slips.
constexpr double kStuck = 1e6;

// Most points of a lone sphere that keep a row.
constexpr std::size_t kMaxKept = 12;

// Mean square of the normals' components across their mean direction, up to which planes count as parallel for the
// lead.
constexpr double kParallel = 0.01;

/// The lead of a proxy, fitted to the leads a_r along its normals d_r: the least squares of w_r (d_r . L - a_r)^2.
struct LeadFit {
    double weight = 0.0;  // N or m: sum w
    Vec3 mean{0.0};       // sum w a d
    Mat3 normals{0.0};    // sum w d d^T

    void add(double w, const Vec3& direction, double ahead) noexcept {
        weight += w;
        mean += w * ahead * direction;
        normals += w * glm::outerProduct(direction, direction);
    }
    /// The mean, and a correction of its components where the normals differ by more than a few degrees.
    [[nodiscard]] Vec3 lead() const noexcept {
        const Vec3 first = mean / weight;
        const Vec3 residual = first - normals / weight * first;
        return first + glm::inverse(normals / weight + Mat3(kParallel)) * residual;
    }
};

/// Of a proxy, against a point that is at `place`, m.
SurfacePlane plane_at(const SurfacePoint& touched, const Vec3& place, const ToolProxy& proxy) {
    const Vec3 away = proxy.position - place;
    const double distance = glm::length(away);
    const Vec3 normal = distance > 0.0 ? away / distance : Vec3(0.0, 1.0, 0.0);
    return {.normal = normal, .offset = glm::dot(normal, place) + proxy.radius, .touched = touched};
}

bool touches_triangle_of(const SurfacePlanes& planes, const SurfacePoint& point) {
    return std::any_of(planes.plane.begin(), planes.plane.begin() + planes.count, [&](const SurfacePlane& plane) {
        return plane.touched.object == point.object && plane.touched.triangle == point.triangle;
    });
}

}  // namespace

ContactCoupling::ContactCoupling(const ParticleModel& model, ClockFunction clock) : clock_(clock), patches_(model) {
    surface_forces_.reserve(kMaxContactRows);
    pressed_.reserve(kMaxContactRows);
    last_pressed_.reserve(patches_.max_particles());
    rows_.reserve(kMaxContactRows);
    friction_.reserve(kMaxProxies);
    depth_.reserve(kMaxContactRows);
    leads_.resize(kMaxProxies);
    for (std::vector<double>& motion : motions_) {
        motion.reserve(kMaxContactRows);
    }
}

std::int64_t ContactCoupling::take_time() noexcept {
    return clock_.take();
}

void ContactCoupling::begin_step(const ToolProxies& tool, const Step& step, const Bodies& bodies,
                                 const ParticleModel& model) {
    step_ = step;
    hip_ = tool.hip().position;
    proxies_ = tool.particles();
    const bool alone = step.coupling.multi_rate == MultiRate::Positions || tool.elasticity().independent();
    damping_ = alone ? step.coupling.hunt_crossley_damping : 0.0;
    particle_count_ = static_cast<double>(proxies_.size());
    keep_pressed();
    keep_last_push();
    patches_.clear();
    rows_.clear();
    friction_.clear();
    paid_ = {};
    work_ = 0.0;
    paid_after_contact_ = Vec3(0.0);
    for (Lead& lead : leads_) {
        lead = {.start = lead.end};
    }
    solver_.restart();  // a warm start would be state
    if (!(step.gain * step.coupling.stiffness > 0.0)) {
        return;
    }
    const StageClock::Span timed(clock_);
    // The tool's rows come proxy by proxy, its normals before its tangents.
    std::span<const ContactRow> rows = tool.rows();
    for (std::uint32_t proxy = 0; proxy < proxies_.size(); ++proxy) {
        const auto end =
            std::find_if(rows.begin(), rows.end(), [&](const ContactRow& row) { return row.proxy != proxy; });
        const auto count = static_cast<std::size_t>(end - rows.begin());
        add_proxy(tool, proxy, rows.first(count), bodies, model);
        rows = rows.subspan(count);
    }
    for (const CouplingRow& row : rows_) {
        patches_.add_row(row.patch, row.direction);
    }
    if (!rows_.empty()) {
        find_tool_compliance(tool);
    }
}

/// Keeps what pressed on the proxies in the last step.
void ContactCoupling::keep_pressed() noexcept {
    std::swap(pressed_, surface_forces_);
    surface_forces_.clear();
    std::erase_if(pressed_, [](const SurfaceForce& surface) { return !(surface.force > 0.0); });
}

/// Keeps what the last step pressed on, for what may be owed after the contact.
void ContactCoupling::keep_last_push() noexcept {
    // Sums over the normals: impulse, and the mean point at which it acted.
    double normal = 0.0;
    Vec3 push(0.0);
    Vec3 arm(0.0);
    for (const CouplingRow& row : rows_) {
        if (row.normal) {
            normal += row.impulse;
            push += row.impulse * row.direction;
            arm += row.impulse * moment_arm(row);
        }
    }
    if (!(normal > 0.0)) {
        return;
    }
    last_push_ = push;
    last_moment_arm_ = arm / normal;
    // The particles of each row, with its share of the impulse.
    last_pressed_.clear();
    for (const CouplingRow& row : rows_) {
        if (row.normal && row.impulse > 0.0) {
            const double share = row.impulse / normal;
            for (const PressedPatches::Pressed& p : patches_.particles(row.patch)) {
                last_pressed_.push_back(
                    {.particle = p.particle, .weight = share * p.weight, .inverse_mass = p.inverse_mass});
            }
        }
    }
}

/// Rows of one proxy, with the particles that take their forces: the tool's own, and normals of the planes near it.
void ContactCoupling::add_proxy(const ToolProxies& tool, std::uint32_t index, std::span<const ContactRow> rows,
                                const Bodies& bodies, const ParticleModel& model) {
    const bool positions = step_.coupling.multi_rate == MultiRate::Positions;
    const ToolProxy& proxy = proxies_[index];
    const auto first_row = static_cast<std::uint16_t>(rows_.size());
    const auto add_normal = [&](const SurfacePlane& plane, bool touches, double depth) {
        rows_.push_back(
            {.proxy = index,
             .patch = patches_.add(plane.touched, {tool.place_of(plane.touched), plane.normal}, bodies, model),
             .surface = static_cast<std::uint32_t>(surface_forces_.size()),
             .direction = plane.normal,
             .depth = depth,
             .goal_speed = glm::dot(plane.normal, proxy.goal_velocity)});
        surface_forces_.push_back({.proxy = index, .plane = plane, .touches = touches});
    };
    std::size_t pressed = 0;
    for (const ContactRow& row : rows) {
        if (!row.tangential) {
            // With positions the proxy's position stands for its planes.
            const double depth = positions ? glm::dot(row.direction, proxy.position - proxy.goal) : row.depth;
            add_normal(proxy.contacts.plane[row.plane], true, depth);
            ++pressed;
        }
    }
    // At an edge, and where a light contact comes and goes, another plane may press before the step has passed. Nothing
    // is coupled that the proxy has not met: surfaces meet it by continuous detection alone.
    const auto add_near = [&](const SurfacePlane& plane) {
        add_normal(plane, false, plane.offset - glm::dot(plane.normal, proxy.free_position));
    };
    const auto pressed_before = std::ranges::equal_range(pressed_, index, {}, &SurfaceForce::proxy);
    if ((pressed > 0 || !pressed_before.empty()) && !positions) {
        for (std::size_t k = proxy.contacts.count; k < proxy.planes.count; ++k) {
            add_near(proxy.planes.plane[k]);
        }
        for (const SurfaceForce& before : pressed_before | std::views::take(proxies_.size() == 1 ? kMaxKept : 0)) {
            const SurfacePoint& point = before.plane.touched;
            if (!touches_triangle_of(proxy.planes, point)) {
                add_near(plane_at(point, tool.place_of(point), proxy));
            }
        }
    }
    const std::size_t normals = rows_.size() - first_row;
    if (rows.empty() || (pressed == rows.size() && !positions)) {
        return;
    }
    // Tangents, with positions also without friction: from the goal to the point that sticks, which is the mean of the
    // contacts, weighted by their shares of the normal force; evenly if friction has not divided it.
    const std::uint32_t patch =
        patches_.add_mean(rows_[first_row].patch, std::span(proxy.friction.share).first(proxy.contacts.count), model);
    const std::array<Vec3, 2> tangents = contact_tangents(proxy.contacts.plane[0].normal);
    for (std::size_t t = 0; t < tangents.size(); ++t) {
        // With positions friction acts at the centre.
        const double depth = positions ? glm::dot(tangents[t], proxy.position - proxy.goal) : rows[pressed + t].depth;
        const Vec3 arm = positions ? Vec3(0.0) : rows[pressed + t].arm;
        rows_.push_back({.proxy = index,
                         .patch = patch,
                         .normal = false,
                         .direction = tangents[t],
                         .arm = arm,
                         .depth = depth,
                         .goal_speed = glm::dot(tangents[t], tool.goal_velocity_at(proxy, arm))});
    }
    const double coefficient = proxy.friction.slides ? step_.contact.dynamic_friction : step_.contact.static_friction;
    friction_.push_back({.first_normal = first_row,
                         .normals = static_cast<std::uint16_t>(normals),
                         .coefficient = positions ? kStuck : coefficient});
}

/// W_rs = d_r . C_ij d_s of the rows, m/N, at the present part of the stiffness, and the skin.
void ContactCoupling::find_tool_compliance(const ToolProxies& tool) {
    const bool positions = step_.coupling.multi_rate == MultiRate::Positions;
    const double coupling = 1.0 / (step_.gain * step_.coupling.stiffness);
    const double spring = particle_count_ * coupling;
    tool_compliance_.resize(rows_.size());
    std::array<ToolElasticity::Push, kMaxContactRows> pushes;  // NOLINT(*-member-init): filled below
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        const CouplingRow& a = rows_[r];
        pushes[r] = tool.push(a.proxy, a.direction, a.arm);
        for (std::size_t s = 0; s <= r; ++s) {
            const CouplingRow& b = rows_[s];
            double compliance = 0.0;
            if (positions) {
                compliance = a.proxy == b.proxy ? spring * glm::dot(a.direction, b.direction) : 0.0;
            } else {
                compliance = tool.elasticity().compliance(pushes[r], pushes[s]) / step_.gain;
            }
            tool_compliance_.set(r, s, compliance);
        }
    }
    add_skin(coupling);
}

/// Adds what the mean compliance to forces that move the whole tool nowhere lacks to `least`, for each of them.
void ContactCoupling::add_skin(double least) noexcept {
    find_motions();
    // Trace of W over these forces, and their number.
    double sum = 0.0;
    double forces = static_cast<double>(rows_.size());
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        sum += tool_compliance_(r, r);
    }
    for (const std::vector<double>& motion : motions_) {
        for (std::size_t r = 0; r < rows_.size(); ++r) {
            const double* const compliance = tool_compliance_.row(r);
            sum -= motion[r] * std::inner_product(motion.begin(), motion.end(), compliance, 0.0);
            forces -= motion[r] * motion[r];
        }
    }
    // Their number is whole but for rounding.
    if (!(forces > 0.5) || !(sum < least * forces)) {
        return;
    }
    const double skin = least - sum / forces;
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        for (std::size_t s = 0; s <= r; ++s) {
            double part = r == s ? 1.0 : 0.0;
            for (const std::vector<double>& motion : motions_) {
                part -= motion[r] * motion[s];
            }
            tool_compliance_.set(r, s, tool_compliance_(r, s) + skin * part);
        }
    }
}

/// What the rows see of the six motions of the whole tool, orthonormal over the rows; 0 where they see fewer.
void ContactCoupling::find_motions() noexcept {
    // Rotations about the mean point of the rows.
    Vec3 centre(0.0);
    for (const CouplingRow& row : rows_) {
        centre += moment_arm(row) / static_cast<double>(rows_.size());
    }
    for (std::vector<double>& motion : motions_) {
        motion.resize(rows_.size());
    }
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        const Vec3& direction = rows_[r].direction;
        const Vec3 moment = glm::cross(moment_arm(rows_[r]) - centre, direction);
        for (glm::length_t axis = 0; axis < 3; ++axis) {
            motions_[static_cast<std::size_t>(axis)][r] = direction[axis];
            motions_[static_cast<std::size_t>(axis) + 3][r] = moment[axis];
        }
    }
    // Gram and Schmidt: each loses what it has in common with those before it.
    const auto dot = [](const std::vector<double>& x, const std::vector<double>& y) {
        return std::inner_product(x.begin(), x.end(), y.begin(), 0.0);
    };
    for (std::size_t k = 0; k < motions_.size(); ++k) {
        std::vector<double>& motion = motions_[k];
        const double whole = dot(motion, motion);
        for (std::size_t i = 0; i < k; ++i) {
            const double common = dot(motion, motions_[i]);
            std::transform(motion.begin(), motion.end(), motions_[i].begin(), motion.begin(),
                           [&](double x, double y) { return x - common * y; });
        }
        const double left = dot(motion, motion);
        const double factor = left > kMinMotion * whole ? 1.0 / std::sqrt(left) : 0.0;
        std::transform(motion.begin(), motion.end(), motion.begin(), [&](double x) { return factor * x; });
    }
}

void ContactCoupling::begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& /*now*/,
                            double h) {
    const StageClock::Span timed(clock_);
    projected_ = false;
    add_work(start);
    patches_.begin(elastic, h);
    for (CouplingRow& row : rows_) {
        row.applied = 0.0;
    }
}

/// Adds the work of the sub-step that has ended with the particles where they are, after collisions too, and begins the
/// next one there.
void ContactCoupling::add_work(const ParticleModel& at) noexcept {
    patches_.advance_places(at);
    for (CouplingRow& row : rows_) {
        const PressedPatches::Places& places = patches_.places(row.patch);
        work_ += glm::dot(row.exerted, places.start - places.now);
        row.exerted = Vec3(0.0);
    }
    // The same for what was paid after a contact.
    if (step_.owed_force != Vec3(0.0)) {
        const Vec3 point = PressedPatches::mean_of(last_pressed_, [&](std::size_t i) { return at.position[i]; });
        work_ += glm::dot(paid_after_contact_, point - last_point_);
        last_point_ = point;
        paid_after_contact_ = Vec3(0.0);
    }
}

void ContactCoupling::end_step(const ParticleModel& model) noexcept {
    const StageClock::Span timed(clock_);
    add_work(model);
    for (const CouplingRow& row : rows_) {
        if (row.normal) {
            SurfaceForce& surface = surface_forces_[row.surface];
            const PressedPatches::Places& places = patches_.places(row.patch);
            surface.plane.velocity = glm::dot(row.direction, places.start - places.reference) / step_.length;
            surface.force = row.impulse / step_.length;
        }
    }
}

/// tau = damping_time + c b of each proxy, with the depth that the last pass has led to: the mean over its planes,
/// weighted by the depths themselves.
void ContactCoupling::find_damping_times() {
    std::array<double, kMaxProxies> depths{};
    std::array<double, kMaxProxies> squares{};
    for (const CouplingRow& row : rows_) {
        if (row.normal) {
            const PressedPatches::Places& places = patches_.places(row.patch);
            const double depth = std::max(0.0, row.depth + glm::dot(row.direction, places.now - places.reference));
            depths[row.proxy] += depth;
            squares[row.proxy] += depth * depth;
        }
    }
    for (CouplingRow& row : rows_) {
        const double depth = depths[row.proxy] > 0.0 ? squares[row.proxy] / depths[row.proxy] : 0.0;
        row.damping_time = step_.coupling.damping_time + damping_ * depth;
    }
}

/// Adds the sub-step's part of the mean lead of each proxy, fitted to tau v along its rows, weighted by their forces.
/// Where the surface recedes so fast that damping leaves no force, weighted by depth, and only to the depth 0.
void ContactCoupling::add_leads(const MovingParticles& now, double h) {
    if (!(damping_ > 0.0 || step_.coupling.damping_time > 0.0)) {
        return;
    }
    std::array<LeadFit, kMaxProxies> by_force{};
    std::array<LeadFit, kMaxProxies> by_depth{};
    for (const CouplingRow& row : rows_) {
        if (!row.normal) {
            continue;
        }
        const PressedPatches::Places& places = patches_.places(row.patch);
        const Vec3 mean = patches_.place_of(row.patch, now.position);
        const double speed = glm::dot(row.direction, mean - places.start) / h - row.goal_speed;
        const double depth = std::max(0.0, row.depth + glm::dot(row.direction, mean - places.reference));
        by_force[row.proxy].add(row.applied, row.direction, row.damping_time * speed);
        by_depth[row.proxy].add(depth, row.direction, std::max(row.damping_time * speed, -depth));
    }
    for (std::size_t i = 0; i < proxies_.size(); ++i) {
        const LeadFit& fit = by_force[i].weight > 0.0 ? by_force[i] : by_depth[i];
        if (fit.weight > 0.0) {
            leads_[i].end += h / step_.length * fit.lead();
        }
    }
}

/// W / (1 + tau / h) + h^2 (P^T Y P / h^2). Rows whose tau differs have no W_rs.
void ContactCoupling::build_block(double h) {
    const std::size_t count = rows_.size();
    block_.resize(count);
    for (std::size_t r = 0; r < count; ++r) {
        const double damped = 1.0 + rows_[r].damping_time / h;
        for (std::size_t s = 0; s <= r; ++s) {
            block_.set(r, s, tool_compliance_(r, s) / damped + h * h * patches_.compliance()(r, s));
        }
    }
}

void ContactCoupling::project(const ParticleModel& start, const MovingParticles& now, double h) {
    const StageClock::Span timed(clock_);
    if (!std::exchange(projected_, true)) {
        patches_.find_turning(start, h);
    }
    patches_.update_now(now.position);
    find_damping_times();
    // b of each row, for the particles without the forces applied so far.
    depth_.clear();
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        const CouplingRow& row = rows_[r];
        const PressedPatches::Places& places = patches_.places(row.patch);
        double applied = 0.0;
        for (std::size_t s = 0; s < rows_.size(); ++s) {
            applied += patches_.compliance()(r, s) * rows_[s].applied;
        }
        applied *= h * h;
        const double depth = row.depth + glm::dot(row.direction, places.now - places.reference) + applied;
        const double approach = (glm::dot(row.direction, places.now - places.start) + applied) / h - row.goal_speed;
        // A plane that is not reached does not damp.
        const double damping_time = row.normal && depth <= 0.0 ? 0.0 : row.damping_time;
        depth_.push_back((depth + damping_time * approach) / (1.0 + row.damping_time / h));
    }
    build_block(h);
    // The forces of the sub-step, and the change since the last pass: x <- x - Y P dl.
    solver_.solve(block_, depth_, friction_);
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        const double force = solver_.force()[r];
        patches_.press(rows_[r].patch, -h * h * (force - rows_[r].applied) * rows_[r].direction, now.position);
        rows_[r].applied = force;
    }
    patches_.move_elastic_bodies(start, h, now.position);
}

/// m, g_i + a - p: from the hip to where the force of a row acts on the tool that its springs hold.
Vec3 ContactCoupling::moment_arm(const CouplingRow& row) const noexcept {
    const ToolProxy& p = proxies_[row.proxy];
    return (step_.coupling.multi_rate == MultiRate::Positions ? p.goal : p.free_position) + row.arm - hip_;
}

/// Adds the owed force to the bodies, divided like the normal forces: at most kMaxPayment times as large as these
/// together at the whole stiffness, and where it pulls not larger, so that no surface is pulled.
void ContactCoupling::pay(const ParticleModel& start, double h, Row* position, Row* pushed) {
    double normal = 0.0;
    Vec3 push(0.0);
    for (const CouplingRow& row : rows_) {
        normal += row.normal ? row.applied : 0.0;
        push += row.normal ? row.applied * row.direction : Vec3(0.0);
    }
    const double owed = glm::length(step_.owed_force);
    if (!(owed > 0.0)) {
        return;
    }
    if (!(normal > 0.0)) {
        pay_after_contact(h, position, pushed);
        return;
    }
    const double most = glm::dot(step_.owed_force, push) > 0.0 ? kMaxPayment * normal / step_.gain : normal;
    const Vec3 force = std::min(1.0, most / owed) * step_.owed_force;
    for (CouplingRow& row : rows_) {
        if (row.normal && row.applied > 0.0) {
            const Vec3 part = (row.applied / normal) * force;
            patches_.press(row.patch, -h * h * part, position);
            patches_.displace(row.patch, -h * h * part, pushed);
            row.exerted += part;
            paid_.force += h * part;
            paid_.torque += h * glm::cross(moment_arm(row), part);
        }
    }
    patches_.move_elastic_bodies(start, h, position);
}

/// Adds the owed force to the particles that were pressed last, unless it pulls.
void ContactCoupling::pay_after_contact(double h, Row* position, Row* pushed) {
    if (!(glm::dot(step_.owed_force, last_push_) > 0.0)) {
        return;
    }
    PressedPatches::displace(last_pressed_, -h * h * step_.owed_force, position);
    PressedPatches::displace(last_pressed_, -h * h * step_.owed_force, pushed);
    paid_after_contact_ = step_.owed_force;
    paid_.force += h * step_.owed_force;
    paid_.torque += h * glm::cross(last_moment_arm_, step_.owed_force);
}

void ContactCoupling::finish(const ParticleModel& start, const MovingParticles& now, double h) {
    if (!projected_) {
        project(start, now, h);  // a solver without passes over the constraints
    }
    const StageClock::Span timed(clock_);
    for (CouplingRow& row : rows_) {
        patches_.displace(row.patch, -h * h * row.applied * row.direction, now.pushed);
        row.impulse += h * row.applied;
        row.exerted = row.applied * row.direction;
    }
    add_leads(now, h);
    pay(start, h, now.position, now.pushed);
}

CoupledForce ContactCoupling::force() const noexcept {
    CoupledForce result;
    // F = sum l d, T = sum (g_i + a - p) x l d.
    for (const CouplingRow& row : rows_) {
        const Vec3 force = (row.impulse / step_.length) * row.direction;
        result.force += force;
        result.torque += glm::cross(moment_arm(row), force);
    }
    result.force += paid_.force / step_.length;
    result.torque += paid_.torque / step_.length;
    // Particles that a surface keeps from their goals, or meets within the step.
    std::array<bool, kMaxProxies> pressed{};
    for (const CouplingRow& row : rows_) {
        pressed[row.proxy] = pressed[row.proxy] || (row.normal && row.impulse > 0.0);
    }
    for (std::size_t i = 0; i < proxies_.size(); ++i) {
        const ToolProxy& p = proxies_[i];
        if (p.in_contact() || pressed[i]) {
            ++result.collided;
            result.depth = std::max(result.depth, glm::length(p.constrained_goal - p.goal));
        }
    }
    return result;
}

}  // namespace haptic::sim
