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
// k W_rr of a row that only the springs to the hand hold back.
constexpr double kMinRelativeCompliance = 1.0;

std::size_t proxies_of(const ContactFrame& frame) HAPTIC_RT {
    return std::min<std::size_t>(frame.proxy_count, kMaxProxies);
}
/// False: there is nothing to couple the grip with.
bool is_coupled(const ContactFrame& frame, double stiffness) HAPTIC_RT {
    return frame.proxy_count > 0 && (frame.flags & HAPTIC_FRAME_CLUTCHED) == 0 && frame.stiffness > 0.0 &&
           stiffness > 0.0;
}
bool holds_positions(const ContactFrame& frame) HAPTIC_RT {
    return (frame.flags & HAPTIC_FRAME_HOLD_POSITIONS) != 0;
}

/// m, largest displacement of a proxy relative to those of its planes whose bit is set; its own without planes. A
/// surface counts as moving even when its plane has reached the end of its horizon.
double relative_displacement(const Vec3& displacement, const ProxyContact& proxy, unsigned planes,
                             double elapsed_s) HAPTIC_RT {
    // Without planes: the proxy's own displacement.
    double square = planes == 0 ? glm::dot(displacement, displacement) : 0.0;
    for (; planes != 0; planes &= planes - 1) {
        const ContactPlane& plane = proxy.planes[std::countr_zero(planes)];
        // Displacement relative to this plane, which moves along its normal.
        const Vec3 relative = displacement - plane.velocity * elapsed_s * to_vec3(plane.normal);
        square = std::max(square, glm::dot(relative, relative));
    }
    return std::sqrt(square);
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

double torque_stiffness_of(const ContactFrame& frame) HAPTIC_RT {
    return frame.torque_stiffness > 0.0 ? frame.torque_stiffness : frame.stiffness;
}

double squared_moment_arm(const ContactFrame& frame) HAPTIC_RT {
    double squares = 0.0;
    for (std::size_t i = 0; i < proxies_of(frame); ++i) {
        const Vec3 offset = to_vec3(frame.proxies[i].rest_offset);
        squares += glm::dot(offset, offset);
    }
    return frame.proxy_count > 0 ? squares / static_cast<double>(proxies_of(frame)) : 0.0;
}

ToolContact::ToolContact()
    : rows_(kMaxContactRows),
      depth_(kMaxContactRows),
      force_(kMaxContactRows),
      displaced_(kMaxContactRows),
      pairs_(kMaxProxies) {}

void ToolContact::load(const ContactFrame& frame) HAPTIC_RT {
    lay_out_rows(frame);
    elements_ = ContactSolver::Elements::New;
    // A limp tool with one stiffness: its proxies are solved one by one, each with a compliance of its own.
    independent_ = frame.compliance_rows == 0 && torque_stiffness_of(frame) == frame.stiffness;
    if (independent_) {
        return;
    }
    if (frame.compliance_rows == 0) {
        fill_compliance(frame, 0, row_count_);
        return;
    }
    compliance_.resize(row_count_);
    for (std::size_t r = 0; r < row_count_; ++r) {
        compliance_.set_lower_row(r, &frame.compliance[compliance_index(r, 0)]);
        // The springs that translate the whole tool with the grip are in series with every contact, so that k W_rr is
        // at least 1, and the limits of stiffness rely on it: a simulator that sends W in m/N would bypass them. This
        // bounds each contact by k, not their sum. A larger diagonal leaves W positive. A tangential row of exactly 0
        // has no friction: the solver excludes it.
        const double diagonal = compliance_(r, r);
        if (!rows_[r].tangential || diagonal != 0.0) {
            compliance_.set(r, r, std::max(diagonal, kMinRelativeCompliance));
        }
    }
    compliance_.mirror();
}

void ToolContact::lay_out_rows(const ContactFrame& frame) HAPTIC_RT {
    const bool rough = frame.static_friction > 0.0;
    const std::size_t rows_before = row_count_;
    bool changed = false;
    row_count_ = 0;
    for (std::size_t i = 0; i < proxies_of(frame); ++i) {
        const ProxyContact& sent = frame.proxies[i];
        ProxyRows& proxy = proxies_[i];
        const ProxyRows before = proxy;
        proxy.first = static_cast<std::uint16_t>(row_count_);
        proxy.normals = static_cast<std::uint16_t>(std::min<std::size_t>(sent.plane_count, kMaxPlanes));
        // Tangents are those of the compliance; a limp tool has them where there is friction.
        proxy.friction =
            frame.compliance_rows > 0 ? (sent.in_contact & HAPTIC_PROXY_TANGENTS) != 0 : rough && proxy.normals > 0;
        changed = changed || proxy.first != before.first || proxy.normals != before.normals ||
                  proxy.friction != before.friction;
        for (std::size_t k = 0; k < proxy.normals; ++k) {
            rows_[row_count_++] = {to_vec3(sent.planes[k].normal), static_cast<std::uint16_t>(i), false};
        }
        if (proxy.friction) {
            for (const Vec3& tangent : contact_tangents(to_vec3(sent.planes[0].normal))) {
                rows_[row_count_++] = {tangent, static_cast<std::uint16_t>(i), true};
            }
        }
    }
    // Forces of other rows are no start for the next solution.
    if (changed || row_count_ != rows_before) {
        solver_.restart();
    }
}

/// Limp tool: k W_rs = k d_r . C_ij d_s for the rows from `begin` to `end`, which become the rows of the matrix.
void ToolContact::fill_compliance(const ContactFrame& frame, std::size_t begin, std::size_t end) HAPTIC_RT {
    compliance_.resize(end - begin);
    const double of_rotation = frame.stiffness / torque_stiffness_of(frame);
    const double shared = 1.0 - of_rotation;
    const double own = static_cast<double>(proxies_of(frame)) * of_rotation + shared;
    for (std::size_t r = begin; r < end; ++r) {
        compliance_.set(r - begin, r - begin, own);
        for (std::size_t s = begin; s < r; ++s) {
            const double between = rows_[r].proxy == rows_[s].proxy ? own : shared;
            compliance_.set(r - begin, s - begin,
                            (1.0 - kSurfaceShare) * between * glm::dot(rows_[r].direction, rows_[s].direction));
        }
    }
}

/// Evaluation of the loaded frame at an instant.
class ToolContact::Instant {
  public:
    Instant(ToolContact& tool, const ContactFrame& frame, double stiffness, const GripMotion& grip,
            std::int64_t time_ns, bool keeps_friction) HAPTIC_RT;
    [[nodiscard]] Contact evaluate() HAPTIC_RT;

  private:
    /// No initialisers on purpose: a tool has many particles.
    struct Particle {
        Vec3 moment_arm;            // m, R (o_i + v_i a): from the grip's origin
        Vec3 position;              // m, free
        Vec3 displacement;          // m, of the free position since the last tick
        Vec3 rest_velocity;         // m/s, R v_i while it is extrapolated
        Vec3 surface_displacement;  // m, of its surface since the last tick
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
    void add_wrench(std::size_t i) HAPTIC_RT;
    void add_normal(std::size_t row, const ContactPlane& plane, const Particle& particle) HAPTIC_RT;
    [[nodiscard]] Contact sums() HAPTIC_RT;
    /// At most the static coefficient: with a larger one a proxy that slides would stick again at once.
    [[nodiscard]] double dynamic_friction() const HAPTIC_RT {
        return std::min(frame_->dynamic_friction, frame_->static_friction);
    }
    [[nodiscard]] std::size_t end_of(std::size_t i) const HAPTIC_RT {
        return tool_->proxies_[i].first + tool_->proxies_[i].count();
    }

    ToolContact* tool_;
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
    double displaced_free_ = 0.0;
    double squared_displacements_ = 0.0;  // m^2
    bool overflows_ = false;              // a force is beyond the range of numbers
};

// NOLINTNEXTLINE(*-member-init): particles_ is filled by place()
ToolContact::Instant::Instant(ToolContact& tool, const ContactFrame& frame, double stiffness, const GripMotion& grip,
                              std::int64_t time_ns, bool keeps_friction) HAPTIC_RT
    : tool_(&tool),
      frame_(&frame),
      stiffness_(stiffness),
      grip_(grip),
      rotation_(glm::mat3_cast(grip.pose.orientation)),
      previous_rotation_(glm::mat3_cast(grip.previous.orientation)),
      count_(proxies_of(frame)),
      time_ns_(time_ns),
      horizon_ns_(horizon_of(frame)),
      announced_(reports_work(frame) ? 0.0 : 1.0),
      keeps_friction_(keeps_friction) {
    // The times come from another process: their difference may overflow.
    std::int64_t age_ns = 0;
    if (__builtin_sub_overflow(time_ns, frame.plane_time_ns, &age_ns)) {
        age_ns = time_ns > frame.plane_time_ns ? horizon_ns_ + 1 : -1;
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
    // Its displacement since the last tick; without a previous pose zero.
    particle.displacement = Vec3(0.0);
    if (grip_.elapsed_s > 0.0) {
        const Vec3 previous_offset = moving_ ? offset - grip_.elapsed_s * rest_velocity : offset;
        particle.displacement = particle.position - (grip_.previous.position + previous_rotation_ * previous_offset);
    }
    contact_.max_moment_arm = std::max(contact_.max_moment_arm, glm::length(offset));
    // Normal rows: depth behind the plane at this time.
    const ProxyRows& rows = tool_->proxies_[i];
    for (std::size_t k = 0; k < rows.normals; ++k) {
        const HalfSpace plane = plane_at(sent.planes[k], frame_->plane_time_ns, time_ns_, horizon_ns_);
        tool_->depth_[rows.first + k] = plane.offset - glm::dot(plane.normal, particle.position);
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
    for (std::size_t r = rows.first + std::size_t{rows.normals}; r < end_of(i); ++r) {
        tool_->depth_[r] =
            state.in_contact ? glm::dot(tool_->rows_[r].direction, state.anchor - particle.position) : 0.0;
    }
}

/// Solves the contact problem: of the whole tool, or of one proxy after another if they are independent.
void ToolContact::Instant::solve_all() HAPTIC_RT {
    const auto violated = [this](std::size_t i) HAPTIC_RT {
        const ProxyRows& rows = tool_->proxies_[i];
        const auto depths = std::span(tool_->depth_).subspan(rows.first, rows.normals);
        return std::any_of(depths.begin(), depths.end(), [](double depth) HAPTIC_RT { return depth > 0.0; });
    };
    bool any = false;
    for (std::size_t i = 0; i < count_; ++i) {
        const bool behind = violated(i);
        any = any || behind;
        if (!tool_->independent_) {
            continue;
        }
        if (behind) {
            tool_->fill_compliance(*frame_, tool_->proxies_[i].first, end_of(i));
            tool_->solver_.restart();
            solve(i, i + 1);
        } else if (keeps_friction_) {
            tool_->friction_[i] = {};
        }
    }
    // No plane is violated: no proxy is pushed, and friction ends.
    if (!tool_->independent_ && any) {
        solve(0, count_);
    } else if (!any && keeps_friction_) {
        tool_->friction_.fill({});
    }
}

/// Solves for the proxies from `begin` to `end`: springs, then the state of friction.
void ToolContact::Instant::solve(std::size_t begin, std::size_t end) HAPTIC_RT {
    const std::size_t first_row = tool_->proxies_[begin].first;
    const std::size_t rows = end_of(end - 1) - first_row;
    // Friction pairs: the static coefficient while a proxy sticks, none in the tick in which it begins to touch.
    std::size_t count = 0;
    for (std::size_t i = begin; i < end; ++i) {
        const ProxyRows& proxy = tool_->proxies_[i];
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
        if (i == 0 || tool_->proxies_[i].friction) {
            displace(i, first_row, forces);
        }
        keep_friction(i, tool_->proxies_[i].friction && pairs[count++].slides);
    }
}

/// Displacements W l of the rows of proxy i, for the forces of the rows from first_row on.
void ToolContact::Instant::displace(std::size_t i, std::size_t first_row, std::span<const double> forces) HAPTIC_RT {
    for (std::size_t r = tool_->proxies_[i].first; r < end_of(i); ++r) {
        const double* const compliance = tool_->compliance_.row(r - first_row);
        tool_->displaced_[r] = dot(forces.data(), compliance, forces.size());
    }
}

/// Forces of the springs. Proxies that static friction cannot hold slide: with the dynamic coefficient they are solved
/// again. Returns the stored energy.
double ToolContact::Instant::solve_springs(std::span<const double> depth, std::span<FrictionRows> pairs) HAPTIC_RT {
    ContactSolver::Result result = tool_->solver_.solve(tool_->compliance_, depth, pairs, tool_->elements_);
    tool_->elements_ = ContactSolver::Elements::Unchanged;
    bool again = false;
    for (FrictionRows& pair : pairs) {
        if (pair.slides && pair.coefficient > dynamic_friction()) {
            pair.coefficient = dynamic_friction();
            again = true;
        }
    }
    if (again) {
        result = tool_->solver_.solve(tool_->compliance_, depth, pairs, tool_->elements_);
    }
    note_overflow(result);
    return result.stored;
}

/// New anchor of proxy i: on the planes, where it stuck or to where it has slid.
void ToolContact::Instant::keep_friction(std::size_t i, bool slides) HAPTIC_RT {
    FrictionState& state = tool_->friction_[i];
    const ProxyRows& proxy = tool_->proxies_[i];
    double pushes = 0.0;
    for (std::size_t r = proxy.first; r < proxy.first + std::size_t{proxy.normals}; ++r) {
        pushes += tool_->force_[r];
    }
    if (!proxy.friction || !(pushes > 0.0)) {
        state = {};
        return;
    }
    // Along the normal of plane 0 as far as it is displaced; along the tangents the old anchor, unless it slides.
    const bool begins = !state.in_contact;
    const Vec3 n = tool_->rows_[proxy.first].direction;
    const Vec3 free = particles_[i].position;
    Vec3 anchor = free + tool_->displaced_[proxy.first] * n;
    for (std::size_t r = proxy.first + std::size_t{proxy.normals}; r < end_of(i); ++r) {
        anchor += (begins || slides ? tool_->displaced_[r] : tool_->depth_[r]) * tool_->rows_[r].direction;
    }
    state = {.anchor = anchor, .in_contact = is_finite(anchor), .sliding = slides && !begins};
}

/// The first particle's proxy: nearest to its free position among the points that are displaced along its rows as it
/// is.
Vec3 ToolContact::Instant::local_proxy() const HAPTIC_RT {
    const ProxyRows& proxy = tool_->proxies_[0];
    const Vec3 free = particles_[0].position;
    std::array<HalfSpace, kMaxPlanes> planes{};
    for (std::size_t k = 0; k < proxy.normals; ++k) {
        const Vec3 n = tool_->rows_[proxy.first + k].direction;
        planes[k] = {n, glm::dot(n, free) + tool_->displaced_[proxy.first + k]};
    }
    Vec3 position = project(free, std::span(planes).first(proxy.normals)).position;
    // With friction also along the tangents.
    for (std::size_t r = proxy.first + std::size_t{proxy.normals}; r < end_of(0); ++r) {
        const Vec3 t = tool_->rows_[r].direction;
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
        const Vec3 n = tool_->rows_[row].direction;
        const double speed = announced_ * plane.velocity - glm::dot(n, particle.rest_velocity);
        contact_.surface_power += force * speed;
        contact_.surface_velocity += force * speed * n;
    }
}

/// Adds the wrench, the power and the displacement of particle i.
void ToolContact::Instant::add_wrench(std::size_t i) HAPTIC_RT {
    const ProxyRows& rows = tool_->proxies_[i];
    const ProxyContact& sent = frame_->proxies[i];
    const Particle& particle = particles_[i];
    // Sums of l d over its rows, and the planes that push.
    Vec3 force(0.0);
    unsigned pushing = 0;
    for (std::size_t r = rows.first; r < end_of(i); ++r) {
        const Vec3 d = tool_->rows_[r].direction;
        force += tool_->force_[r] * d;
        const std::size_t plane = r - rows.first;
        if (plane < rows.normals && tool_->force_[r] > 0.0) {
            pushing |= 1U << plane;
            add_normal(r, sent.planes[plane], particle);
        } else if (plane >= rows.normals && moving_) {
            // A surface that drags the particle along.
            contact_.surface_power +=
                tool_->force_[r] * glm::dot(d, announced_ * to_vec3(sent.surface_velocity) - particle.rest_velocity);
        }
    }
    contact_.wrench.force += force;
    contact_.wrench.torque += glm::cross(particle.moment_arm, force);
    // Displacement relative to the planes that push, and to the surface to which it sticks; or to all planes.
    const bool in_contact = pushing != 0;
    const unsigned planes = in_contact ? pushing : (1U << rows.normals) - 1U;
    double displacement = relative_displacement(particle.displacement, sent, planes, grip_.elapsed_s);
    if (in_contact && rows.friction) {
        displacement = std::max(displacement, glm::length(particle.displacement - particle.surface_displacement));
    }
    contact_.in_contact += in_contact ? 1U : 0U;
    (in_contact ? displaced_in_contact_ : displaced_free_) += displacement;
    squared_displacements_ += displacement * displacement;
}

/// Sums over all particles, at the rendered stiffness.
Contact ToolContact::Instant::sums() HAPTIC_RT {
    for (std::size_t i = 0; i < count_; ++i) {
        add_wrench(i);
    }
    contact_.proxy = local_proxy();
    if (overflows_) {
        contact_.wrench.force = Vec3(std::numeric_limits<double>::infinity());
    }
    contact_.tool_displacement = std::sqrt(squared_displacements_ / static_cast<double>(count_));
    if (contact_.in_contact == 0) {
        contact_.displacement = displaced_free_ / static_cast<double>(count_);
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
    const auto rows = static_cast<std::ptrdiff_t>(tool_->row_count_);
    for (std::vector<double>* values : {&tool_->force_, &tool_->displaced_}) {
        std::fill_n(values->begin(), rows, 0.0);
    }
    for (std::size_t i = 0; i < count_; ++i) {
        place(i);
    }
    solve_all();
    return sums();
}

Contact ToolContact::render(const ContactFrame& frame, double stiffness, const GripMotion& grip,
                            std::int64_t time_ns) HAPTIC_RT {
    if (!is_coupled(frame, stiffness)) {
        // No wrench, and the next contact starts without friction state.
        forget_friction();
        Contact none;
        none.proxy = grip.pose.position;
        return none;
    }
    return holds_positions(frame) ? hold_positions(frame, stiffness, grip)
                                  : Instant(*this, frame, stiffness, grip, time_ns, true).evaluate();
}

Contact ToolContact::preview(const ContactFrame& frame, double stiffness, const Pose& grip,
                             std::int64_t time_ns) HAPTIC_RT {
    if (!is_coupled(frame, stiffness)) {
        return {};
    }
    const GripMotion still{.pose = grip, .previous = grip};
    return holds_positions(frame) ? hold_positions(frame, stiffness, still)
                                  : Instant(*this, frame, stiffness, still, time_ns, false).evaluate();
}

}  // namespace haptic
