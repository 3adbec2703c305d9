#include "rendering/tool_contact.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <span>

#include "haptic/numeric.hpp"
#include "rendering/local_proxy.hpp"
#include "vector_kernels.hpp"

namespace haptic {
namespace {

// Maximum number of simulation steps for which planes of a published frame are extrapolated: half a step of margin for
// a late one.
constexpr double kHorizonSteps = 1.5;
// ns, limit of the horizon where the time that a frame took to be published (computation, network) extends it.
constexpr std::int64_t kMaxHorizonNs = 50'000'000;
// s, time constant with which a particle's sticking position moves to the simulation's.
constexpr double kStickCorrectionTimeS = 0.1;

std::size_t proxies_of(const ContactFrame& frame) HAPTIC_RT {
    return std::min<std::size_t>(frame.proxy_count, kMaxProxies);
}
/// False: there is nothing to couple the grip with.
bool is_coupled(const PreparedFrame* prepared, double stiffness) HAPTIC_RT {
    if (prepared == nullptr) {
        return false;
    }
    const ContactFrame& frame = prepared->frame;
    return frame.proxy_count > 0 && (frame.flags & HAPTIC_FRAME_CLUTCHED) == 0 && frame.stiffness > 0.0 &&
           stiffness > 0.0;
}
bool holds_positions(const ContactFrame& frame) HAPTIC_RT {
    return (frame.flags & HAPTIC_FRAME_HOLD_POSITIONS) != 0;
}

/// m^2, square of the largest displacement of a proxy relative to those of its planes whose bit is set; of its own
/// without planes. A surface counts as moving even when its plane has reached the end of its horizon.
double squared_displacement(const Vec3& displacement, const ProxyContact& proxy, unsigned planes,
                            double elapsed_s) HAPTIC_RT {
    // Without planes: the proxy's own displacement.
    double square = planes == 0 ? glm::dot(displacement, displacement) : 0.0;
    for (; planes != 0; planes &= planes - 1) {
        const ContactPlane& plane = proxy.planes[std::countr_zero(planes)];
        // Displacement relative to this plane, which moves along its normal.
        const Vec3 relative = displacement - plane.velocity * elapsed_s * to_vec3(plane.normal);
        square = std::max(square, glm::dot(relative, relative));
    }
    return square;
}

/// The thesis' scheme (section 5.4.1): touching proxies are where the frame has them, and F = k sum d_i / N,
/// T = k_t sum (x_i - p) x d_i / N, with d_i from the free position to that of the frame.
Contact hold_positions(const ContactFrame& frame, double stiffness, const GripMotion& grip) HAPTIC_RT {
    Contact contact;
    contact.proxy = grip.pose.position;
    const double particle_stiffness = stiffness / static_cast<double>(proxies_of(frame));
    const double torque_ratio = torque_stiffness_of(frame) / frame.stiffness;
    for (std::size_t i = 0; i < proxies_of(frame); ++i) {
        const ProxyContact& sent = frame.proxies[i];
        const Vec3 arm = grip.pose.orientation * to_vec3(sent.rest_offset);
        const bool touches = (sent.in_contact & HAPTIC_PROXY_TOUCHES) != 0;
        const Vec3 d = touches ? to_vec3(sent.position) - grip.pose.position - arm : Vec3(0.0);
        contact.in_contact += touches ? 1u : 0u;
        contact.wrench.force += particle_stiffness * d;
        contact.wrench.torque += particle_stiffness * torque_ratio * glm::cross(arm, d);
        contact.stored += 0.5 * particle_stiffness * std::max(1.0, torque_ratio) * glm::dot(d, d);
        if (i == 0) {
            contact.proxy = grip.pose.position + arm + d;
        }
    }
    return contact;
}

/// ns after plane_time_ns, for which planes are extrapolated: until the next frame should have been published. The
/// planes of one from another machine are older from the beginning, and so are those of the next.
std::int64_t horizon_of(const ContactFrame& frame) HAPTIC_RT {
    const auto steps_ns = static_cast<std::int64_t>(kHorizonSteps * static_cast<double>(frame.step_ns));
    std::int64_t underway_ns = 0;
    if (__builtin_sub_overflow(frame.publish_time_ns, frame.plane_time_ns, &underway_ns)) {
        underway_ns = 0;
    }
    const std::int64_t longest_ns = std::max<std::int64_t>(kMaxHorizonNs - steps_ns, 0);
    return steps_ns + std::clamp<std::int64_t>(underway_ns, 0, longest_ns);
}

}  // namespace

double squared_moment_arm(const ContactFrame& frame) HAPTIC_RT {
    double squares = 0.0;
    for (std::size_t i = 0; i < proxies_of(frame); ++i) {
        const Vec3 offset = to_vec3(frame.proxies[i].rest_offset);
        squares += glm::dot(offset, offset);
    }
    return frame.proxy_count > 0 ? squares / static_cast<double>(proxies_of(frame)) : 0.0;
}

ToolContact::ToolContact()
    : depth_(kMaxContactRows), force_(kMaxContactRows), displaced_(kMaxContactRows), pairs_(kMaxProxies) {}

void ToolContact::load(const PreparedFrame& frame) HAPTIC_RT {
    // Forces of other rows are no start for the next solution.
    if (prepared_ == nullptr || !frame.has_rows_of(*prepared_)) {
        solver_.restart();
    }
    prepared_ = &frame;
    elements_ = ContactSolver::Elements::New;
}

/// Evaluation of the loaded frame at an instant.
class ToolContact::Instant {
  public:
    Instant(ToolContact& tool, double stiffness, const GripMotion& grip, std::int64_t time_ns,
            bool keeps_friction) HAPTIC_RT;
    [[nodiscard]] Contact evaluate() HAPTIC_RT;

  private:
    /// No initialisers on purpose: a tool has many particles.
    struct Particle {
        Vec3 moment_arm;            // m, R (o_i + v_i a): from the grip's origin
        Vec3 position;              // m, free
        Vec3 displacement;          // m, of the free position since the last tick, if the previous pose is known
        Vec3 rest_velocity;         // m/s, R v_i while it is extrapolated
        Vec3 surface_displacement;  // m, of its surface since the last tick
        bool is_behind;             // one of its planes
        double displaced_squared;   // m^2, relative to its surfaces; set by add_displacement()
    };

    void place(std::size_t i) HAPTIC_RT;
    void carry_anchor(const ProxyContact& sent, const Vec3& surface_displacement, FrictionState& state) const HAPTIC_RT;
    void solve_all() HAPTIC_RT;
    void solve(std::size_t begin, std::size_t end) HAPTIC_RT;
    [[nodiscard]] double solve_springs(std::span<const double> depth, std::span<FrictionRows> pairs) HAPTIC_RT;
    void note_overflow(const ContactSolver::Result& result) HAPTIC_RT {
        overflows_ = overflows_ || result.residual == std::numeric_limits<double>::max();
    }
    void displace(std::size_t i, std::size_t first_row, std::span<const double> forces) HAPTIC_RT;
    void keep_friction(std::size_t i, bool slides) HAPTIC_RT;
    [[nodiscard]] Vec3 local_proxy() const HAPTIC_RT;
    [[nodiscard]] unsigned add_wrench(std::size_t i) HAPTIC_RT;
    void add_displacement(std::size_t i, unsigned pushing) HAPTIC_RT;
    void add_normal(std::size_t row, const ContactPlane& plane, const Particle& particle) HAPTIC_RT;
    [[nodiscard]] Contact sums() HAPTIC_RT;
    /// At most the static coefficient: with a larger one a proxy that slides would stick again at once.
    [[nodiscard]] double dynamic_friction() const HAPTIC_RT {
        return std::min(frame_->dynamic_friction, frame_->static_friction);
    }
    /// k W of the rows that are solved together.
    [[nodiscard]] const ComplianceMatrix& compliance() const HAPTIC_RT {
        return prepared_->is_independent() ? tool_->own_compliance_ : prepared_->compliance();
    }

    ToolContact* tool_;
    const PreparedFrame* prepared_;
    const ContactFrame* frame_;
    double stiffness_;
    GripMotion grip_;
    Mat3 rotation_;
    Mat3 previous_rotation_;
    std::size_t count_;
    std::int64_t time_ns_;
    std::int64_t horizon_ns_;
    double age_s_ = 0.0;   // s, for which planes and rest offsets are extrapolated
    bool moving_ = false;  // they move: their time has come, and the horizon has not been reached
    double announced_;     // 1: the surfaces' velocities count as power, 0: the frame reports their work instead
    bool keeps_friction_;
    std::array<Particle, kMaxProxies> particles_;  // filled by place()
    Contact contact_;
    double pushes_ = 0.0;       // m, sum of the normal forces per stiffness
    double normal_work_ = 0.0;  // m^2, sum l b of the normal rows
    double displaced_in_contact_ = 0.0;
    double squared_displacements_ = 0.0;  // m^2
    double squared_moment_arm_ = 0.0;     // m^2, largest
    bool overflows_ = false;              // a force is beyond the range of numbers
};

// NOLINTNEXTLINE(*-member-init): particles_ is filled by place()
ToolContact::Instant::Instant(ToolContact& tool, double stiffness, const GripMotion& grip, std::int64_t time_ns,
                              bool keeps_friction) HAPTIC_RT
    : tool_(&tool),
      prepared_(tool.prepared_),
      frame_(&prepared_->frame),
      stiffness_(stiffness),
      grip_(grip),
      rotation_(glm::mat3_cast(grip.pose.orientation)),
      previous_rotation_(glm::mat3_cast(grip.previous.orientation)),
      count_(prepared_->proxies()),
      time_ns_(time_ns),
      horizon_ns_(horizon_of(*frame_)),
      announced_(reports_work(*frame_) ? 0.0 : 1.0),
      keeps_friction_(keeps_friction) {
    // The times come from another process: their difference may overflow.
    std::int64_t age_ns = 0;
    if (__builtin_sub_overflow(time_ns, frame_->plane_time_ns, &age_ns)) {
        age_ns = time_ns > frame_->plane_time_ns ? horizon_ns_ + 1 : -1;
    }
    // Planes are extrapolated forwards only: those dated ahead of now rest until then.
    moving_ = age_ns >= 0 && age_ns <= horizon_ns_;
    age_s_ = seconds(std::clamp<std::int64_t>(age_ns, 0, horizon_ns_));
}

/// Moves the anchor with the surface, and towards the simulation's position. Each process lets a particle stick where
/// it found it touching, and carries it along with the surface on its own, so the two positions differ and drift. While
/// both report sticking, the simulation's position is the right one, because it holds the object there. The
/// WrenchFollower bounds what the hand feels of this.
void ToolContact::Instant::carry_anchor(const ProxyContact& sent, const Vec3& surface_displacement,
                                        FrictionState& state) const HAPTIC_RT {
    state.anchor += surface_displacement;
    if (state.sliding || (sent.in_contact & HAPTIC_PROXY_STICKS) == 0) {
        return;
    }
    // The simulation's position, extrapolated with the surface to now; first-order low-pass towards it.
    const Vec3 there = to_vec3(sent.position) + age_s_ * to_vec3(sent.surface_velocity);
    state.anchor += grip_.elapsed_s / (grip_.elapsed_s + kStickCorrectionTimeS) * (there - state.anchor);
}

/// Free position of particle i, and the depths of its rows.
void ToolContact::Instant::place(std::size_t i) HAPTIC_RT {
    const ProxyContact& sent = frame_->proxies[i];
    Particle& particle = particles_[i];
    // x_i = p + R (o_i + v_i a).
    const Vec3 rest_velocity = to_vec3(sent.rest_velocity);
    const Vec3 offset = to_vec3(sent.rest_offset) + age_s_ * rest_velocity;
    particle.moment_arm = rotation_ * offset;
    particle.position = grip_.pose.position + particle.moment_arm;
    particle.rest_velocity = moving_ ? rotation_ * rest_velocity : Vec3(0.0);
    particle.surface_displacement = moving_ ? grip_.elapsed_s * to_vec3(sent.surface_velocity) : Vec3(0.0);
    // Its displacement since the last tick, if the previous pose is known.
    if (grip_.elapsed_s > 0.0) {
        const Vec3 previous_offset = moving_ ? offset - grip_.elapsed_s * rest_velocity : offset;
        particle.displacement = particle.position - (grip_.previous.position + previous_rotation_ * previous_offset);
    }
    squared_moment_arm_ = std::max(squared_moment_arm_, glm::dot(offset, offset));
    // Normal rows: depth behind the plane at this time.
    const ProxyRows& rows = prepared_->rows_of(i);
    particle.is_behind = false;
    for (std::size_t k = 0; k < rows.normals; ++k) {
        const HalfSpace plane = plane_at(sent.planes[k], frame_->plane_time_ns, time_ns_, horizon_ns_);
        const double depth = plane.offset - glm::dot(plane.normal, particle.position);
        tool_->depth_[rows.first + k] = depth;
        particle.is_behind = particle.is_behind || depth > 0.0;
    }
    // Tangential rows: distance to the anchor. A proxy that only begins to touch has none.
    FrictionState& state = tool_->friction_[i];
    if (!rows.friction) {
        state = keeps_friction_ ? FrictionState{} : state;
        return;
    }
    if (state.in_contact && keeps_friction_) {
        carry_anchor(sent, particle.surface_displacement, state);
    }
    for (std::size_t r = rows.first + std::size_t{rows.normals}; r < rows.end(); ++r) {
        tool_->depth_[r] =
            state.in_contact ? glm::dot(prepared_->row(r).direction, state.anchor - particle.position) : 0.0;
    }
}

/// Solves the contact problem: of the whole tool, or of one proxy after another if they are independent.
void ToolContact::Instant::solve_all() HAPTIC_RT {
    bool any = false;
    for (std::size_t i = 0; i < count_; ++i) {
        const bool behind = particles_[i].is_behind;
        any = any || behind;
        if (!prepared_->is_independent()) {
            continue;
        }
        if (behind) {
            const ProxyRows& rows = prepared_->rows_of(i);
            prepared_->copy_compliance(rows.first, rows.end(), tool_->own_compliance_);
            tool_->solver_.restart();
            solve(i, i + 1);
        } else if (keeps_friction_) {
            tool_->friction_[i] = {};
        }
    }
    // No plane is violated: no proxy is pushed, and friction ends.
    if (!prepared_->is_independent() && any) {
        solve(0, count_);
    } else if (!any && keeps_friction_) {
        tool_->friction_.fill({});
    }
}

/// Solves for the proxies from `begin` to `end`: springs, then the state of friction.
void ToolContact::Instant::solve(std::size_t begin, std::size_t end) HAPTIC_RT {
    const std::size_t first_row = prepared_->rows_of(begin).first;
    const std::size_t rows = prepared_->rows_of(end - 1).end() - first_row;
    // Friction pairs: the static coefficient while a proxy sticks, none in the tick in which it begins to touch.
    std::size_t count = 0;
    for (std::size_t i = begin; i < end; ++i) {
        const ProxyRows& proxy = prepared_->rows_of(i);
        if (proxy.friction) {
            const FrictionState& state = tool_->friction_[i];
            const double coefficient = state.sliding ? dynamic_friction() : frame_->static_friction;
            tool_->pairs_[count++] = {.first_normal = static_cast<std::uint16_t>(proxy.first - first_row),
                                      .normals = proxy.normals,
                                      .coefficient = state.in_contact ? coefficient : 0.0};
        }
    }
    const auto pairs = std::span(tool_->pairs_).first(count);
    contact_.stored += solve_springs(std::span<const double>(tool_->depth_).subspan(first_row, rows), pairs);
    const std::span<const double> forces = tool_->solver_.force();
    std::copy(forces.begin(), forces.end(), tool_->force_.begin() + static_cast<std::ptrdiff_t>(first_row));
    if (!keeps_friction_) {
        return;
    }
    // State of friction, which needs the displacements W l; so does the proxy that is published.
    count = 0;
    for (std::size_t i = begin; i < end; ++i) {
        const bool rough = prepared_->rows_of(i).friction;
        if (i == 0 || rough) {
            displace(i, first_row, forces);
        }
        if (rough) {
            keep_friction(i, pairs[count++].slides);
        }
    }
}

/// Displacements W l of the rows of proxy i, for the forces of the rows from first_row on.
void ToolContact::Instant::displace(std::size_t i, std::size_t first_row, std::span<const double> forces) HAPTIC_RT {
    const ProxyRows& rows = prepared_->rows_of(i);
    for (std::size_t r = rows.first; r < rows.end(); ++r) {
        tool_->displaced_[r] = dot(forces.data(), compliance().row(r - first_row), forces.size());
    }
}

/// Forces of the springs. Proxies that static friction cannot hold slide: with the dynamic coefficient they are solved
/// again. Returns the stored energy.
double ToolContact::Instant::solve_springs(std::span<const double> depth, std::span<FrictionRows> pairs) HAPTIC_RT {
    ContactSolver::Result result = tool_->solver_.solve(compliance(), depth, pairs, tool_->elements_);
    tool_->elements_ = ContactSolver::Elements::Unchanged;
    bool again = false;
    for (FrictionRows& pair : pairs) {
        if (pair.slides && pair.coefficient > dynamic_friction()) {
            pair.coefficient = dynamic_friction();
            again = true;
        }
    }
    if (again) {
        result = tool_->solver_.solve(compliance(), depth, pairs, tool_->elements_);
    }
    note_overflow(result);
    return result.stored;
}

/// New anchor of proxy i, which has friction: on the planes, where it stuck or to where it has slid.
void ToolContact::Instant::keep_friction(std::size_t i, bool slides) HAPTIC_RT {
    FrictionState& state = tool_->friction_[i];
    const ProxyRows& proxy = prepared_->rows_of(i);
    double pushes = 0.0;
    for (std::size_t r = proxy.first; r < proxy.first + std::size_t{proxy.normals}; ++r) {
        pushes += tool_->force_[r];
    }
    if (!(pushes > 0.0)) {
        state = {};
        return;
    }
    // Along the normal of plane 0 as far as it is displaced; along the tangents the old anchor, unless it slides.
    const bool begins = !state.in_contact;
    const Vec3 n = prepared_->row(proxy.first).direction;
    const Vec3 free = particles_[i].position;
    Vec3 anchor = free + tool_->displaced_[proxy.first] * n;
    for (std::size_t r = proxy.first + std::size_t{proxy.normals}; r < proxy.end(); ++r) {
        anchor += (begins || slides ? tool_->displaced_[r] : tool_->depth_[r]) * prepared_->row(r).direction;
    }
    state = {.anchor = anchor, .in_contact = is_finite(anchor), .sliding = slides && !begins};
}

/// The first particle's proxy: nearest to its free position among the points that are displaced along its rows as it
/// is.
Vec3 ToolContact::Instant::local_proxy() const HAPTIC_RT {
    const ProxyRows& proxy = prepared_->rows_of(0);
    const Vec3 free = particles_[0].position;
    std::array<HalfSpace, kMaxPlanes> planes{};
    for (std::size_t k = 0; k < proxy.normals; ++k) {
        const Vec3 n = prepared_->row(proxy.first + k).direction;
        planes[k] = {n, glm::dot(n, free) + tool_->displaced_[proxy.first + k]};
    }
    Vec3 position = project(free, std::span(planes).first(proxy.normals)).position;
    // With friction also along the tangents.
    for (std::size_t r = proxy.first + std::size_t{proxy.normals}; r < proxy.end(); ++r) {
        const Vec3 t = prepared_->row(r).direction;
        position += (tool_->displaced_[r] - glm::dot(t, position - free)) * t;
    }
    return position;
}

/// Adds the work and the power of a normal row that pushes.
void ToolContact::Instant::add_normal(std::size_t row, const ContactPlane& plane, const Particle& particle) HAPTIC_RT {
    const double force = tool_->force_[row];
    pushes_ += force;
    normal_work_ += force * tool_->depth_[row];
    if (moving_) {
        // m/s, at which surface and rest offset approach each other.
        const Vec3 n = prepared_->row(row).direction;
        const double speed = announced_ * plane.velocity - glm::dot(n, particle.rest_velocity);
        contact_.surface_power += force * speed;
        contact_.surface_velocity += force * speed * n;
    }
}

/// Adds the wrench and the power of particle i. Returns the planes that push, as bits.
unsigned ToolContact::Instant::add_wrench(std::size_t i) HAPTIC_RT {
    const ProxyRows& rows = prepared_->rows_of(i);
    unsigned pushing = 0;
    for (std::size_t k = 0; k < rows.normals; ++k) {
        pushing |= tool_->force_[rows.first + k] > 0.0 ? 1U << k : 0U;
    }
    // Without a push there is no friction either.
    if (pushing == 0) {
        return 0;
    }
    const ProxyContact& sent = frame_->proxies[i];
    const Particle& particle = particles_[i];
    // Sum of l d over its rows.
    Vec3 force(0.0);
    for (std::size_t r = rows.first; r < rows.end(); ++r) {
        const Vec3 d = prepared_->row(r).direction;
        force += tool_->force_[r] * d;
        const std::size_t plane = r - rows.first;
        if ((pushing >> plane & 1U) != 0) {
            add_normal(r, sent.planes[plane], particle);
        } else if (plane >= rows.normals && moving_) {
            // A surface that drags the particle along.
            contact_.surface_power +=
                tool_->force_[r] * glm::dot(d, announced_ * to_vec3(sent.surface_velocity) - particle.rest_velocity);
        }
    }
    contact_.wrench.force += force;
    contact_.wrench.torque += glm::cross(particle.moment_arm, force);
    ++contact_.in_contact;
    return pushing;
}

/// Adds the displacement of particle i: relative to the planes that push, and to the surface to which it sticks; or to
/// all planes.
void ToolContact::Instant::add_displacement(std::size_t i, unsigned pushing) HAPTIC_RT {
    const ProxyRows& rows = prepared_->rows_of(i);
    Particle& particle = particles_[i];
    const bool in_contact = pushing != 0;
    const unsigned planes = in_contact ? pushing : (1U << rows.normals) - 1U;
    double square = squared_displacement(particle.displacement, frame_->proxies[i], planes, grip_.elapsed_s);
    if (in_contact && rows.friction) {
        const Vec3 sliding = particle.displacement - particle.surface_displacement;
        square = std::max(square, glm::dot(sliding, sliding));
    }
    particle.displaced_squared = square;
    displaced_in_contact_ += in_contact ? std::sqrt(square) : 0.0;
    squared_displacements_ += square;
}

/// Sums over all particles, at the rendered stiffness.
Contact ToolContact::Instant::sums() HAPTIC_RT {
    const bool has_moved = grip_.elapsed_s > 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
        const unsigned pushing = add_wrench(i);
        if (has_moved) {
            add_displacement(i, pushing);
        }
    }
    contact_.proxy = local_proxy();
    if (overflows_) {
        contact_.wrench.force = Vec3(std::numeric_limits<double>::infinity());
    }
    contact_.max_moment_arm = std::sqrt(squared_moment_arm_);
    contact_.tool_displacement = std::sqrt(squared_displacements_ / static_cast<double>(count_));
    if (contact_.in_contact == 0) {
        double displaced = 0.0;
        for (std::size_t i = 0; i < count_ && has_moved; ++i) {
            displaced += std::sqrt(particles_[i].displaced_squared);
        }
        contact_.displacement = displaced / static_cast<double>(count_);
        return contact_;
    }
    contact_.displacement = displaced_in_contact_ / static_cast<double>(contact_.in_contact);
    contact_.surface_velocity /= pushes_;
    // Stiffness of the contacts along their mean push, as part of k: M / N for M of N proxies of a limp tool, 1 for a
    // rigid one that does not rotate.
    const double part = pushes_ * pushes_ / normal_work_;
    contact_.share = part > 0.0 ? std::min(part, 1.0) : 1.0;
    // From forces per stiffness to forces.
    contact_.wrench.force *= stiffness_;
    contact_.wrench.torque *= stiffness_;
    contact_.stored *= stiffness_;
    contact_.surface_power *= stiffness_;
    return contact_;
}

Contact ToolContact::Instant::evaluate() HAPTIC_RT {
    const auto rows = static_cast<std::ptrdiff_t>(prepared_->row_count());
    for (std::vector<double>* values : {&tool_->force_, &tool_->displaced_}) {
        std::fill_n(values->begin(), rows, 0.0);
    }
    for (std::size_t i = 0; i < count_; ++i) {
        place(i);
    }
    solve_all();
    return sums();
}

Contact ToolContact::render(double stiffness, const GripMotion& grip, std::int64_t time_ns) HAPTIC_RT {
    if (!is_coupled(prepared_, stiffness)) {
        // No wrench, and the next contact starts without friction state.
        forget_friction();
        Contact none;
        none.proxy = grip.pose.position;
        return none;
    }
    const ContactFrame& frame = prepared_->frame;
    return holds_positions(frame) ? hold_positions(frame, stiffness, grip)
                                  : Instant(*this, stiffness, grip, time_ns, true).evaluate();
}

Contact ToolContact::preview(double stiffness, const Pose& grip, std::int64_t time_ns) HAPTIC_RT {
    if (!is_coupled(prepared_, stiffness)) {
        return {};
    }
    const GripMotion still{.pose = grip, .previous = grip};
    const ContactFrame& frame = prepared_->frame;
    return holds_positions(frame) ? hold_positions(frame, stiffness, still)
                                  : Instant(*this, stiffness, still, time_ns, false).evaluate();
}

}  // namespace haptic
