#include "rendering/tool_contact.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <span>

#include "contact_kernels.hpp"
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
// Part of the largest depth of a proxy: one of its planes that it is less behind is not violated but by rounding.
constexpr double kReached = 1e-12;
// Velocities of rest offsets that do not move.
constexpr ProxyVectors kAtRest{};

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

/// The largest length of the first `count` vectors.
double longest(const ProxyVectors& v, std::size_t count) HAPTIC_RT {
    ProxyValues squares;  // NOLINT(*-member-init)
    for (std::size_t i = 0; i < count; ++i) {
        squares[i] = v.x[i] * v.x[i] + v.y[i] * v.y[i] + v.z[i] * v.z[i];
    }
    return std::sqrt(largest_magnitude(squares.data(), count));
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

ToolContact::ToolContact()
    : kernels_(&widest_contact_kernels()),
      depth_(kMaxContactRows),
      force_(kMaxContactRows),
      displaced_(kMaxContactRows),
      pairs_(kMaxProxies) {}

void ToolContact::load(PreparedFrame& frame) HAPTIC_RT {
    // Forces of other rows are no start for the next solution.
    const bool same_rows = prepared_ != nullptr && !prepared_->is_independent() && frame.has_rows_of(*prepared_);
    if (!is_new_ || !same_rows) {
        start_ = same_rows ? solver_.pushing() : RowSet{};
    }
    prepared_ = &frame;
    is_new_ = true;
}

/// Before the first solution of a frame.
void ToolContact::start_frame() HAPTIC_RT {
    if (!is_new_) {
        return;
    }
    is_new_ = false;
    if (start_ == RowSet{}) {
        solver_.restart();
    }
    solver_.borrow(prepared_->is_independent() ? nullptr : &prepared_->factor_of(start_));
}

Wrench ToolContact::springs_at(const Pose& grip, std::int64_t time_ns) HAPTIC_RT {
    if (!is_coupled(prepared_, 1.0)) {
        return {};
    }
    const FramePreview* ahead =
        is_new_ ? prepared_->preview_from({.layout = 0, .pushing = start_, .grip = grip, .time_ns = time_ns}) : nullptr;
    if (ahead == nullptr) {
        return preview(1.0, grip, time_ns).wrench;
    }
    is_new_ = false;
    solver_.start(prepared_->row_count(), ahead->pushing);
    solver_.borrow(prepared_->is_independent() ? nullptr : &prepared_->previewed_factor());
    return ahead->wrench;
}

FrameStart ToolContact::next_start(const Pose& grip, std::int64_t time_ns) const HAPTIC_RT {
    FrameStart start;
    start.grip = grip;
    start.time_ns = time_ns;
    if (prepared_ != nullptr && !prepared_->is_independent()) {
        start.layout = prepared_->layout();
        start.pushing = is_new_ ? start_ : solver_.pushing();
    }
    return start;
}

void ToolContact::preview_ahead(PreparedFrame& frame, const FrameStart& start) HAPTIC_RT {
    if (frame.defect() != FrameDefect::None || frame.has_friction() || !is_coupled(&frame, 1.0)) {
        return;
    }
    FramePreview ahead;
    ahead.start = start;
    if (frame.is_independent() || frame.layout() != start.layout) {
        ahead.start.pushing = {};
    }
    prepared_ = &frame;
    start_ = ahead.start.pushing;
    is_new_ = true;
    solver_.start(frame.row_count(), start_);
    ahead.wrench = preview(1.0, start.grip, start.time_ns).wrench;
    ahead.pushing = frame.is_independent() ? RowSet{} : solver_.pushing();
    frame.set_preview(ahead);
}

void ToolContact::forget_friction() HAPTIC_RT {
    if (has_friction_state_) {
        friction_.fill({});
        has_friction_state_ = false;
    }
}

/// Evaluation of the loaded frame at an instant.
class ToolContact::Instant {
  public:
    Instant(ToolContact& tool, double stiffness, const GripMotion& grip, std::int64_t time_ns,
            bool keeps_friction) HAPTIC_RT;
    [[nodiscard]] Contact evaluate() HAPTIC_RT;

  private:
    void place() HAPTIC_RT;
    void find_motion() HAPTIC_RT;
    void find_depths() HAPTIC_RT;
    void find_friction_depths() HAPTIC_RT;
    void carry_anchor(std::size_t i, FrictionState& state) const HAPTIC_RT;
    void solve_all() HAPTIC_RT;
    void solve_independent() HAPTIC_RT;
    void add_friction(std::size_t i) HAPTIC_RT;
    [[nodiscard]] bool holds_alone(std::size_t i) HAPTIC_RT;
    void displace_alone(std::size_t i) HAPTIC_RT;
    void solve_together() HAPTIC_RT;
    [[nodiscard]] double solve(std::size_t begin, std::size_t end) HAPTIC_RT;
    [[nodiscard]] double solve_springs(std::span<const double> depth, std::span<FrictionRows> pairs) HAPTIC_RT;
    void note_overflow(const ContactSolver::Result& result) HAPTIC_RT {
        overflows_ = overflows_ || result.residual == std::numeric_limits<double>::max();
    }
    void displace(std::size_t i, std::size_t first_row) HAPTIC_RT;
    [[nodiscard]] bool touches(std::size_t i) const HAPTIC_RT { return proxies_->touches[i] > 0.0; }
    [[nodiscard]] double sum_of(const ProxyValues& values) const HAPTIC_RT { return sum(values.data(), count_); }
    [[nodiscard]] Vec3 sum_of(const ProxyVectors& v) const HAPTIC_RT { return {sum_of(v.x), sum_of(v.y), sum_of(v.z)}; }
    void forget_friction(std::size_t i) HAPTIC_RT {
        if (keeps_friction_) {
            tool_->friction_[i] = {};
        }
    }
    void keep_friction(std::size_t i, bool slides) HAPTIC_RT;
    void copy_depths(std::size_t i) HAPTIC_RT;
    void copy_depths() HAPTIC_RT;
    void copy_forces(std::size_t i) HAPTIC_RT;
    [[nodiscard]] Vec3 local_proxy() HAPTIC_RT;
    void pull() HAPTIC_RT;
    void add_wrench() HAPTIC_RT;
    void add_power() HAPTIC_RT;
    void find_displacements() HAPTIC_RT;
    [[nodiscard]] Contact sums() HAPTIC_RT;
    /// m, of the proxy's surface since the last tick.
    [[nodiscard]] Vec3 surface_displacement(const ProxyContact& sent) const HAPTIC_RT {
        return moving_ ? grip_.elapsed_s * to_vec3(sent.surface_velocity) : Vec3(0.0);
    }
    /// m, from where friction acts on proxy i to its centre.
    [[nodiscard]] Vec3 arm_of_friction(std::size_t i) const HAPTIC_RT {
        return prepared_->friction_arm(i) * to_vec3(frame_->proxies[i].planes[0].normal);
    }
    /// m, by which the grip has rolled proxy i on its surface since the last tick.
    [[nodiscard]] Vec3 rolled(std::size_t i) const HAPTIC_RT {
        const Vec3 arm = arm_of_friction(i);
        return grip_.elapsed_s > 0.0 ? turn_ * arm - arm : Vec3(0.0);
    }
    /// The static coefficient until a proxy slides, then the dynamic one.
    [[nodiscard]] double friction_of(const FrictionState& state) const HAPTIC_RT {
        return state.sliding ? dynamic_friction() : frame_->static_friction;
    }
    /// At most the static coefficient: with a larger one a proxy that slides would stick again at once.
    [[nodiscard]] double dynamic_friction() const HAPTIC_RT {
        return std::min(frame_->dynamic_friction, frame_->static_friction);
    }
    /// k W of the rows that are solved together.
    [[nodiscard]] const ComplianceMatrix& compliance() const HAPTIC_RT {
        return prepared_->is_independent() ? tool_->own_compliance_ : prepared_->compliance();
    }

    ToolContact* tool_;
    const ContactKernels* kernels_;
    const PreparedFrame* prepared_;
    const ContactFrame* frame_;
    double stiffness_;
    GripMotion grip_;
    Mat3 rotation_;
    Mat3 previous_rotation_;
    Mat3 turn_;  // of the grip since the last tick, if the previous pose is known
    std::size_t count_;
    std::int64_t horizon_ns_;
    double age_s_ = 0.0;   // s, for which planes and rest offsets are extrapolated
    bool moving_ = false;  // they move: their time has come, and the horizon has not been reached
    double announced_;     // 1: the surfaces' velocities count as power, 0: the frame reports their work instead
    bool keeps_friction_;
    Proxies* proxies_;
    Contact contact_;
    double pushes_ = 0.0;                  // m, sum of the normal forces per stiffness
    double normal_work_ = 0.0;             // m^2, sum l b of the normal rows
    double deepest_ = 0.0;                 // m, largest depth of a plane
    double stored_ = 0.0;                  // m^2, V of a tool with a compliance
    Vec3 friction_torque_{0.0, 0.0, 0.0};  // m^2, of friction about the centres of the proxies
    bool rest_moves_ = false;              // a rest offset, while it is extrapolated
    bool overflows_ = false;               // a force is beyond the range of numbers
};

ToolContact::Instant::Instant(ToolContact& tool, double stiffness, const GripMotion& grip, std::int64_t time_ns,
                              bool keeps_friction) HAPTIC_RT
    : tool_(&tool),
      kernels_(tool.kernels_),
      prepared_(tool.prepared_),
      frame_(&prepared_->frame),
      stiffness_(stiffness),
      grip_(grip),
      rotation_(glm::mat3_cast(grip.pose.orientation)),
      previous_rotation_(glm::mat3_cast(grip.previous.orientation)),
      turn_(rotation_* glm::transpose(previous_rotation_)),
      count_(prepared_->proxies()),
      horizon_ns_(horizon_of(*frame_)),
      announced_(reports_work(*frame_) ? 0.0 : 1.0),
      keeps_friction_(keeps_friction),
      proxies_(&tool.proxies_) {
    // The times come from another process: their difference may overflow.
    std::int64_t age_ns = 0;
    if (__builtin_sub_overflow(time_ns, frame_->plane_time_ns, &age_ns)) {
        age_ns = time_ns > frame_->plane_time_ns ? horizon_ns_ + 1 : -1;
    }
    // Planes are extrapolated forwards only: those dated ahead of now rest until then.
    moving_ = age_ns >= 0 && age_ns <= horizon_ns_;
    rest_moves_ = moving_ && prepared_->rest_moves();
    age_s_ = seconds(std::clamp<std::int64_t>(age_ns, 0, horizon_ns_));
}

/// Moves the anchor with the surface, and as the grip rolls the sphere on it, and towards the simulation's position.
/// Each process lets a particle stick where it found it touching, and carries it along with the surface on its own, so
/// the two positions differ and drift. While both report sticking, the simulation's position is the right one, because
/// it holds the object there. The WrenchFollower bounds what the hand feels of this.
void ToolContact::Instant::carry_anchor(std::size_t i, FrictionState& state) const HAPTIC_RT {
    const ProxyContact& sent = frame_->proxies[i];
    state.anchor += surface_displacement(sent) + rolled(i);
    if (state.sliding || (sent.in_contact & HAPTIC_PROXY_STICKS) == 0) {
        return;
    }
    // The simulation's position, extrapolated with the surface to now; first-order low-pass towards it.
    const Vec3 there = to_vec3(sent.position) + age_s_ * to_vec3(sent.surface_velocity);
    state.anchor += grip_.elapsed_s / (grip_.elapsed_s + kStickCorrectionTimeS) * (there - state.anchor);
}

/// Free positions: x_i = p + R (o_i + v_i a).
void ToolContact::Instant::place() HAPTIC_RT {
    Proxies& to = *proxies_;
    kernels_->rotate(&rotation_[0].x, prepared_->rest_offset(), age_s_, prepared_->rest_velocity(), count_, to.arm);
    const Vec3 grip = grip_.pose.position;
    for (std::size_t i = 0; i < count_; ++i) {
        to.position.x[i] = grip.x + to.arm.x[i];
        to.position.y[i] = grip.y + to.arm.y[i];
        to.position.z[i] = grip.z + to.arm.z[i];
    }
}

/// Displacements of the free positions since the last tick, and the velocities of the rest offsets.
void ToolContact::Instant::find_motion() HAPTIC_RT {
    Proxies& to = *proxies_;
    const ProxyVectors& velocity = prepared_->rest_velocity();
    if (grip_.elapsed_s > 0.0) {
        const double age_s = moving_ ? age_s_ - grip_.elapsed_s : age_s_;
        kernels_->rotate(&previous_rotation_[0].x, prepared_->rest_offset(), age_s, velocity, count_, to.displacement);
        const Vec3 before = grip_.previous.position;
        for (std::size_t i = 0; i < count_; ++i) {
            to.displacement.x[i] = to.position.x[i] - (before.x + to.displacement.x[i]);
            to.displacement.y[i] = to.position.y[i] - (before.y + to.displacement.y[i]);
            to.displacement.z[i] = to.position.z[i] - (before.z + to.displacement.z[i]);
        }
    }
    if (rest_moves_) {
        kernels_->rotate(&rotation_[0].x, velocity, 0.0, velocity, count_, to.rest_velocity);
    }
}

/// Depths of the normal rows: b = offset - n . x_i, with the planes at this time.
void ToolContact::Instant::find_depths() HAPTIC_RT {
    const ProxyVectors& position = proxies_->position;
    deepest_ = -std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < prepared_->plane_count(); ++k) {
        double* const depth = proxies_->depth[k].data();
        kernels_->find_depths(prepared_->planes(k), age_s_, position, count_, depth);
        deepest_ = std::max(deepest_, largest(depth, count_));
    }
    if (!prepared_->is_independent()) {
        copy_depths();
    }
}

/// Depths of the tangential rows: the distances to the anchor. A proxy that only begins to touch has none.
void ToolContact::Instant::find_friction_depths() HAPTIC_RT {
    if (!prepared_->has_friction()) {
        if (keeps_friction_) {
            tool_->forget_friction();
        }
        return;
    }
    for (std::size_t i = 0; i < count_; ++i) {
        FrictionState& state = tool_->friction_[i];
        const ProxyRows& rows = prepared_->rows_of(i);
        if (!rows.friction) {
            forget_friction(i);
            continue;
        }
        if (state.in_contact && keeps_friction_) {
            carry_anchor(i, state);
        }
        for (std::size_t r = rows.first + std::size_t{rows.normals}; r < rows.end(); ++r) {
            tool_->depth_[r] =
                state.in_contact ? glm::dot(prepared_->row(r).direction, state.anchor - proxies_->position.at(i)) : 0.0;
        }
    }
}

/// Solves the contact problem: of the whole tool, or of each proxy if they are independent.
void ToolContact::Instant::solve_all() HAPTIC_RT {
    if (!(deepest_ > 0.0)) {
        // No plane is violated: no proxy is pushed, and friction ends.
        for (std::size_t k = 0; k < kMaxPlanes; ++k) {
            std::fill_n(proxies_->force[k].begin(), count_, 0.0);
        }
        std::fill_n(proxies_->energy.begin(), count_, 0.0);
        if (keeps_friction_) {
            tool_->forget_friction();
        }
        return;
    }
    if (prepared_->is_independent()) {
        solve_independent();
    } else {
        solve_together();
    }
}

/// Independent proxies: normal forces of all at once, then friction of those that have it.
void ToolContact::Instant::solve_independent() HAPTIC_RT {
    Proxies& to = *proxies_;
    if (!std::isfinite(deepest_)) {
        overflows_ = true;
        for (ProxyValues& depth : to.depth) {
            std::replace_if(
                depth.begin(), depth.begin() + static_cast<std::ptrdiff_t>(count_),
                [](double b) HAPTIC_RT { return !std::isfinite(b); }, ProxyPlanes::kNone);
        }
    }
    prepared_->independent_proxies().solve(to.depth, to.force);
    // V = 1/2 l b where each row that pushes is exact.
    std::fill_n(to.energy.begin(), count_, 0.0);
    for (std::size_t k = 0; k < prepared_->plane_count(); ++k) {
        for (std::size_t i = 0; i < count_; ++i) {
            to.energy[i] += 0.5 * to.force[k][i] * to.depth[k][i];
        }
    }
    for (std::size_t i = 0; i < count_ && prepared_->has_friction(); ++i) {
        add_friction(i);
    }
}

/// Adds friction to proxy i of an independent tool, whose normal forces without friction are known.
void ToolContact::Instant::add_friction(std::size_t i) HAPTIC_RT {
    const ProxyRows& rows = prepared_->rows_of(i);
    bool pushes = false;
    for (std::size_t k = 0; k < rows.normals; ++k) {
        pushes = pushes || proxies_->force[k][i] > 0.0;
    }
    if (!rows.friction || !pushes) {
        forget_friction(i);
        return;
    }
    copy_depths(i);
    if (holds_alone(i)) {
        return;
    }
    // Several planes push, and the friction on one of them may move the proxy away from another.
    prepared_->copy_compliance(rows.first, rows.end(), tool_->own_compliance_);
    tool_->solver_.restart();
    proxies_->energy[i] = solve(i, i + 1);
    copy_forces(i);
}

/// Friction of an independent proxy that begins to touch, or that only its first plane pushes: its tangents are
/// perpendicular to that normal, so that the forces along them are the depths, shortened to the radius of the cone.
/// False if that is not the solution, because it reaches another plane.
bool ToolContact::Instant::holds_alone(std::size_t i) HAPTIC_RT {
    const ProxyRows& rows = prepared_->rows_of(i);
    const FrictionState& state = tool_->friction_[i];
    const std::size_t tangents = rows.first + std::size_t{rows.normals};
    const double compliance = prepared_->independent_proxies().compliance();
    // m, depth behind the first plane if no other one pushes; forces are depths by the compliance, normal and
    // tangential.
    double alone = tool_->depth_[rows.first];
    double deepest = std::fabs(alone);
    for (std::size_t k = 0; k < rows.normals; ++k) {
        const std::size_t r = rows.first + k;
        tool_->force_[r] = proxies_->force[k][i];
        deepest = std::max(deepest, std::fabs(tool_->depth_[r]));
        alone = k > 0 && tool_->force_[r] > 0.0 ? 0.0 : alone;
    }
    std::array<double, 2> stuck = {tool_->depth_[tangents], tool_->depth_[tangents + 1]};
    bool slides = true;
    double factor = 0.0;
    if (state.in_contact) {
        if (!(alone > 0.0)) {
            return false;
        }
        const double length = std::sqrt(stuck[0] * stuck[0] + stuck[1] * stuck[1]);
        double radius = friction_of(state) * alone;
        slides = !(length <= radius) || !(radius > 0.0);
        // A few roundings inside the edge, so that the cone holds exactly.
        radius = std::min(radius, dynamic_friction() * alone) * (1.0 - 4.0 * std::numeric_limits<double>::epsilon());
        factor = slides ? radius / length : 1.0;
        if (!std::isfinite(length)) {
            overflows_ = true;
            factor = 0.0;
            stuck = {0.0, 0.0};
        }
    }
    tool_->force_[tangents] = factor * stuck[0] / compliance;
    tool_->force_[tangents + 1] = factor * stuck[1] / compliance;
    displace_alone(i);
    // The other planes must not be reached.
    for (std::size_t r = rows.first + std::size_t{1}; r < tangents && state.in_contact; ++r) {
        if (tool_->depth_[r] - tool_->displaced_[r] > kReached * deepest) {
            return false;
        }
    }
    // V = l^T b - 1/2 l^T W l.
    double energy = 0.0;
    for (std::size_t r = rows.first; r < rows.end(); ++r) {
        energy += tool_->force_[r] * (tool_->depth_[r] - 0.5 * tool_->displaced_[r]);
    }
    proxies_->energy[i] = energy;
    if (keeps_friction_) {
        keep_friction(i, slides);
    }
    return true;
}

/// Displacements W l of the rows of an independent proxy i.
void ToolContact::Instant::displace_alone(std::size_t i) HAPTIC_RT {
    const ProxyRows& rows = prepared_->rows_of(i);
    const double compliance = prepared_->independent_proxies().compliance();
    for (std::size_t r = rows.first; r < rows.end(); ++r) {
        Vec3 others(0.0);
        for (std::size_t s = rows.first; s < rows.end(); ++s) {
            others += (s == r ? 0.0 : tool_->force_[s]) * prepared_->row(s).direction;
        }
        const double coupled = (1.0 - kSurfaceShare) * glm::dot(prepared_->row(r).direction, others);
        tool_->displaced_[r] = compliance * (tool_->force_[r] + coupled);
    }
}

/// One problem for the whole tool.
void ToolContact::Instant::solve_together() HAPTIC_RT {
    stored_ = solve(0, count_);
    for (std::size_t i = 0; i < count_; ++i) {
        copy_forces(i);
    }
}

/// Depths of the normals of proxy i, to the rows.
void ToolContact::Instant::copy_depths(std::size_t i) HAPTIC_RT {
    const ProxyRows& rows = prepared_->rows_of(i);
    for (std::size_t k = 0; k < rows.normals; ++k) {
        tool_->depth_[rows.first + k] = proxies_->depth[k][i];
    }
}

/// Depths of all normals, to the rows.
void ToolContact::Instant::copy_depths() HAPTIC_RT {
    // As if each proxy had all planes: what is too much is overwritten by the next proxy, or behind the last row.
    static_assert(kMaxContactRows >= (kMaxProxies - 1) * (kMaxPlanes + 2) + kMaxPlanes);
    double* const rows = tool_->depth_.data();
    for (std::size_t i = 0; i < count_; ++i) {
        const std::size_t first = prepared_->rows_of(i).first;
        for (std::size_t k = 0; k < kMaxPlanes; ++k) {
            rows[first + k] = proxies_->depth[k][i];
        }
    }
}

/// Forces of the normals of proxy i, from the rows.
void ToolContact::Instant::copy_forces(std::size_t i) HAPTIC_RT {
    const ProxyRows& rows = prepared_->rows_of(i);
    const double* const force = &tool_->force_[rows.first];
    for (std::size_t k = 0; k < kMaxPlanes; ++k) {
        proxies_->force[k][i] = k < rows.normals ? force[k] : 0.0;
    }
}

/// Solves for the proxies from `begin` to `end`: springs, then the state of friction. Returns the stored energy.
double ToolContact::Instant::solve(std::size_t begin, std::size_t end) HAPTIC_RT {
    const std::size_t first_row = prepared_->rows_of(begin).first;
    const std::size_t rows = prepared_->rows_of(end - 1).end() - first_row;
    // Friction pairs: the static coefficient while a proxy sticks, none in the tick in which it begins to touch.
    std::size_t count = 0;
    for (std::size_t i = begin; i < end && prepared_->has_friction(); ++i) {
        const ProxyRows& proxy = prepared_->rows_of(i);
        if (proxy.friction) {
            const FrictionState& state = tool_->friction_[i];
            tool_->pairs_[count++] = {.first_normal = static_cast<std::uint16_t>(proxy.first - first_row),
                                      .normals = proxy.normals,
                                      .coefficient = state.in_contact ? friction_of(state) : 0.0};
        }
    }
    const auto pairs = std::span(tool_->pairs_).first(count);
    const double stored = solve_springs(std::span<const double>(tool_->depth_).subspan(first_row, rows), pairs);
    const std::span<const double> forces = tool_->solver_.force();
    std::copy(forces.begin(), forces.end(), tool_->force_.begin() + static_cast<std::ptrdiff_t>(first_row));
    if (!keeps_friction_) {
        return stored;
    }
    // State of friction, which needs the displacements W l; so does the proxy that is published.
    count = 0;
    for (std::size_t i = begin; i < end && (i == 0 || prepared_->has_friction()); ++i) {
        const bool rough = prepared_->rows_of(i).friction;
        if (i == 0 || rough) {
            displace(i, first_row);
        }
        if (rough) {
            keep_friction(i, pairs[count++].slides);
        }
    }
    return stored;
}

/// Displacements W l of the rows of proxy i: what the solution of the rows from first_row on has taken from their
/// depths.
void ToolContact::Instant::displace(std::size_t i, std::size_t first_row) HAPTIC_RT {
    const ProxyRows& rows = prepared_->rows_of(i);
    const std::span<const double> deficit = tool_->solver_.deficit();
    for (std::size_t r = rows.first; r < rows.end(); ++r) {
        tool_->displaced_[r] = tool_->depth_[r] - deficit[r - first_row];
    }
}

/// Forces of the springs. Proxies that static friction cannot hold slide: with the dynamic coefficient they are solved
/// again. Returns the stored energy.
double ToolContact::Instant::solve_springs(std::span<const double> depth, std::span<FrictionRows> pairs) HAPTIC_RT {
    // The elements are those of the frame's factor; independent proxies restart.
    constexpr auto unchanged = ContactSolver::Elements::Unchanged;
    ContactSolver::Result result = tool_->solver_.solve(compliance(), depth, pairs, unchanged);
    bool again = false;
    for (FrictionRows& pair : pairs) {
        if (pair.slides && pair.coefficient > dynamic_friction()) {
            pair.coefficient = dynamic_friction();
            again = true;
        }
    }
    if (again) {
        result = tool_->solver_.solve(compliance(), depth, pairs, unchanged);
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
    const Vec3 free = proxies_->position.at(i);
    Vec3 anchor = free + tool_->displaced_[proxy.first] * n;
    for (std::size_t r = proxy.first + std::size_t{proxy.normals}; r < proxy.end(); ++r) {
        anchor += (begins || slides ? tool_->displaced_[r] : tool_->depth_[r]) * prepared_->row(r).direction;
    }
    state = {.anchor = anchor, .in_contact = is_finite(anchor), .sliding = slides && !begins};
    tool_->has_friction_state_ = true;
}

/// The first particle's proxy: nearest to its free position among the points that are displaced along its rows as it
/// is.
Vec3 ToolContact::Instant::local_proxy() HAPTIC_RT {
    const ProxyRows& proxy = prepared_->rows_of(0);
    const Vec3 free = proxies_->position.at(0);
    bool pushes = false;
    for (std::size_t k = 0; k < proxy.normals; ++k) {
        pushes = pushes || proxies_->force[k][0] > 0.0;
    }
    if (!(deepest_ > 0.0) || (prepared_->is_independent() && !pushes)) {
        return free;
    }
    if (prepared_->is_independent() && !proxy.friction) {
        for (std::size_t k = 0; k < proxy.normals; ++k) {
            tool_->force_[proxy.first + k] = proxies_->force[k][0];
        }
        displace_alone(0);
    }
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

/// The normal forces of each proxy: whether one of its planes pushes, and the sum of l d over its rows.
void ToolContact::Instant::pull() HAPTIC_RT {
    Proxies& to = *proxies_;
    std::fill_n(to.touches.begin(), count_, 0.0);
    for (ProxyValues* values : {&to.pull.x, &to.pull.y, &to.pull.z}) {
        std::fill_n(values->begin(), count_, 0.0);
    }
    for (std::size_t k = 0; k < prepared_->plane_count(); ++k) {
        const ProxyValues& force = to.force[k];
        kernels_->add_pull({&prepared_->planes(k), force.data()}, count_, to.touches.data(), to.pull);
        pushes_ += sum_of(force);
        normal_work_ += dot(force.data(), to.depth[k].data(), count_);
    }
    // Without a push there is no friction either.
    for (std::size_t i = 0; i < count_ && prepared_->has_friction(); ++i) {
        const ProxyRows& rows = prepared_->rows_of(i);
        if (!rows.friction || !touches(i)) {
            continue;
        }
        Vec3 friction(0.0);
        for (std::size_t r = rows.first + std::size_t{rows.normals}; r < rows.end(); ++r) {
            friction += tool_->force_[r] * prepared_->row(r).direction;
        }
        to.pull.set(i, to.pull.at(i) + friction);
        friction_torque_ -= glm::cross(arm_of_friction(i), friction);
    }
}

/// Wrench F = sum of the pulls, T = sum of arm x pull, and what friction adds where the spheres touch.
void ToolContact::Instant::add_wrench() HAPTIC_RT {
    kernels_->cross(proxies_->arm, proxies_->pull, count_, proxies_->torque);
    contact_.wrench = {sum_of(proxies_->pull), sum_of(proxies_->torque) + friction_torque_};
}

/// Power at which surfaces and rest offsets approach each other, while they move.
void ToolContact::Instant::add_power() HAPTIC_RT {
    ProxyVectors& velocity = proxies_->surface_velocity;
    ProxyValues& power = proxies_->power;
    for (ProxyValues* values : {&velocity.x, &velocity.y, &velocity.z, &power}) {
        std::fill_n(values->begin(), count_, 0.0);
    }
    const ProxyVectors& rest = rest_moves_ ? proxies_->rest_velocity : kAtRest;
    for (std::size_t k = 0; k < prepared_->plane_count(); ++k) {
        kernels_->add_power({&prepared_->planes(k), proxies_->force[k].data()}, announced_, rest, count_, power.data(),
                            velocity);
    }
    // A surface that drags the particle along.
    for (std::size_t i = 0; i < count_ && prepared_->has_friction(); ++i) {
        const ProxyRows& rows = prepared_->rows_of(i);
        const Vec3 surface = announced_ * to_vec3(frame_->proxies[i].surface_velocity);
        const Vec3 drags = surface - rest.at(i);
        for (std::size_t r = rows.first + std::size_t{rows.normals}; r < rows.end() && touches(i); ++r) {
            power[i] += tool_->force_[r] * glm::dot(prepared_->row(r).direction, drags);
        }
    }
    contact_.surface_power = sum_of(power);
    contact_.surface_velocity = sum_of(velocity);
}

/// Displacement of each proxy since the last tick: the largest relative to its planes that push, and to the surface to
/// which it sticks; to all its planes, if none pushes; its own without planes. A surface counts as moving even when its
/// plane has reached the end of its horizon.
void ToolContact::Instant::find_displacements() HAPTIC_RT {
    const ProxyVectors& d = proxies_->displacement;
    const ProxyValues& touches_any = proxies_->touches;
    double* const __restrict square = proxies_->displaced.data();
    const ProxyValues& first = prepared_->planes(0).offset;
    for (std::size_t i = 0; i < count_; ++i) {
        const double own = d.x[i] * d.x[i] + d.y[i] * d.y[i] + d.z[i] * d.z[i];
        square[i] = first[i] == ProxyPlanes::kNone ? own : 0.0;
    }
    for (std::size_t k = 0; k < prepared_->plane_count(); ++k) {
        kernels_->relative_squares({&prepared_->planes(k), proxies_->force[k].data()}, grip_.elapsed_s, d,
                                   touches_any.data(), count_, square);
    }
    for (std::size_t i = 0; i < count_ && prepared_->has_friction(); ++i) {
        if (touches(i) && prepared_->rows_of(i).friction) {
            const Vec3 sliding = d.at(i) - surface_displacement(frame_->proxies[i]) - rolled(i);
            square[i] = std::max(square[i], glm::dot(sliding, sliding));
        }
    }
    // Mean square of all; then the mean of those in contact, or of all if none is.
    contact_.tool_displacement = std::sqrt(sum_of(proxies_->displaced) / static_cast<double>(count_));
    const double none = contact_.in_contact == 0 ? 1.0 : 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
        square[i] = std::sqrt(square[i]) * std::max(touches_any[i], none);
    }
    const double counted = contact_.in_contact == 0 ? static_cast<double>(count_) : contact_.in_contact;
    contact_.displacement = sum_of(proxies_->displaced) / counted;
}

/// Sums over all particles, at the rendered stiffness.
Contact ToolContact::Instant::sums() HAPTIC_RT {
    contact_.max_moment_arm = longest(proxies_->arm, count_) + prepared_->max_friction_arm();
    contact_.proxy = local_proxy();
    if (deepest_ > 0.0) {
        pull();
        contact_.in_contact = static_cast<std::uint32_t>(sum_of(proxies_->touches));
    } else {
        std::fill_n(proxies_->touches.begin(), count_, 0.0);
    }
    if (grip_.elapsed_s > 0.0) {
        find_displacements();
    }
    if (contact_.in_contact > 0) {
        add_wrench();
        if (moving_ && (announced_ > 0.0 || rest_moves_)) {
            add_power();
        }
        contact_.surface_velocity /= pushes_;
        // Stiffness of the contacts along their mean push, as part of k: M / N for M of N proxies of a limp tool, 1 for
        // a rigid one that does not rotate.
        const double part = pushes_ * pushes_ / normal_work_;
        contact_.share = part > 0.0 ? std::min(part, 1.0) : 1.0;
        // From forces per stiffness to forces.
        contact_.wrench.force *= stiffness_;
        contact_.wrench.torque *= stiffness_;
        contact_.stored = stiffness_ * (prepared_->is_independent() ? sum_of(proxies_->energy) : stored_);
        contact_.surface_power *= stiffness_;
    }
    if (overflows_) {
        contact_.wrench.force = Vec3(std::numeric_limits<double>::infinity());
    }
    return contact_;
}

Contact ToolContact::Instant::evaluate() HAPTIC_RT {
    place();
    find_motion();
    find_depths();
    find_friction_depths();
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
    start_frame();
    const ContactFrame& frame = prepared_->frame;
    return holds_positions(frame) ? hold_positions(frame, stiffness, grip)
                                  : Instant(*this, stiffness, grip, time_ns, true).evaluate();
}

Contact ToolContact::preview(double stiffness, const Pose& grip, std::int64_t time_ns) HAPTIC_RT {
    if (!is_coupled(prepared_, stiffness)) {
        return {};
    }
    start_frame();
    const GripMotion still{.pose = grip, .previous = grip};
    const ContactFrame& frame = prepared_->frame;
    return holds_positions(frame) ? hold_positions(frame, stiffness, still)
                                  : Instant(*this, stiffness, still, time_ns, false).evaluate();
}

}  // namespace haptic
