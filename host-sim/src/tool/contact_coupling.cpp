#include "tool/contact_coupling.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numeric>

#include "dynamics/elastic_bodies.hpp"
#include "dynamics/model_bodies.hpp"
#include "dynamics/rotation.hpp"
#include "dynamics/rows.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {
namespace {

// Most patches of normals: every proxy with all its planes.
constexpr std::size_t kMaxNormals = kMaxProxies * kMaxSurfacePlanes;
// Most particles under all masks together. Rows beyond it press on the corners of the touched triangle alone.
constexpr std::size_t kMaxPressed = std::size_t{1} << 18;
// Most answers of particles to patches without an allocation.
constexpr std::size_t kMaxAnswers = std::size_t{1} << 22;
// Largest payment of what is owed, in contact forces.
constexpr double kMaxPayment = 10.0;
// A motion of the whole tool counts as one of these rows if the others leave this part of it.
constexpr double kMinMotion = 1e-6;
// Of a patch's spread: that across which it counts as a line.
constexpr double kLeastSpread = 1e-6;
// Largest part by which that changes a weight: a mask on the rim of a sheet must not shrink to a point.
constexpr double kMostShift = 0.5;
// Friction coefficient that never slips.
constexpr double kStuck = 1e6;

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

}  // namespace

ContactCoupling::ContactCoupling(const ParticleModel& model, ClockFunction clock)
    : clock_(clock), was_pressed_(kMaxProxies, 0), scattered_(model.size(), 0.0) {
    // Twice, for the mean patches of tangents.
    const std::size_t most =
        std::min(kMaxPressed, kMaxNormals * std::max(model.size(), PressureMask::kCornerParticles));
    pressed_.reserve(2 * most);
    last_pressed_.reserve(most);
    patches_.reserve(kMaxNormals + kMaxProxies);
    rows_.reserve(kMaxContactRows);
    friction_.reserve(kMaxProxies);
    depth_.reserve(kMaxContactRows);
    leads_.resize(kMaxProxies);
    if (!model.elasticity.elements.empty()) {
        columns_.reserve(model.size());
        answering_.reserve(kMaxNormals + 3 * kMaxProxies);
        answers_.reserve(std::min(kMaxAnswers, (kMaxNormals + kMaxProxies) * model.size()));
        turns_.resize(model.size(), 0);
        std::vector<ParticleRange> solids = solids_of(model);
        std::erase_if(solids, [&](const ParticleRange& solid) { return !has_no_pinned(model, solid); });
        for (const ParticleRange& solid : solids) {
            std::fill_n(turns_.begin() + solid.begin, solid.end - solid.begin, std::uint8_t{1});
        }
        turning_.reserve(solids.size());
        turning_answers_.resize(solids.empty() ? 0 : model.size());
        patch_levers_.reserve(answering_.capacity());
        row_levers_.reserve(kMaxNormals + 6 * kMaxProxies);
    }
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
    note_pressed();
    keep_last_push();
    pressed_.clear();
    patches_.clear();
    rows_.clear();
    friction_.clear();
    normal_patches_ = 0;
    pressed_of_normals_ = 0;
    paid_ = {};
    work_ = 0.0;
    answered_step_ = 0.0;
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
        add_proxy(proxy, rows.first(count), bodies, model);
        rows = rows.subspan(count);
    }
    if (!rows_.empty()) {
        find_tool_compliance(tool);
    }
}

/// Notes the proxies on which a row pressed in the last step.
void ContactCoupling::note_pressed() noexcept {
    std::fill(was_pressed_.begin(), was_pressed_.end(), std::uint8_t{0});
    for (const CouplingRow& row : rows_) {
        if (row.normal && row.impulse > 0.0) {
            was_pressed_[row.proxy] = 1;
        }
    }
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
            arm += row.impulse * moment_arm(row.proxy);
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
            const Patch& patch = patches_[row.patch];
            const double share = row.impulse / normal;
            for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
                last_pressed_.push_back({pressed_[p].particle, share * pressed_[p].weight, pressed_[p].inverse_mass});
            }
        }
    }
}

/// Rows of one proxy, with the particles that take their forces: the tool's own, and normals of the planes near it.
void ContactCoupling::add_proxy(std::uint32_t index, std::span<const ContactRow> rows, const Bodies& bodies,
                                const ParticleModel& model) {
    const bool positions = step_.coupling.multi_rate == MultiRate::Positions;
    const ToolProxy& proxy = proxies_[index];
    const auto first_row = static_cast<std::uint16_t>(rows_.size());
    const auto first_patch = static_cast<std::uint32_t>(patches_.size());
    std::size_t normals = 0;
    for (const ContactRow& row : rows) {
        if (!row.tangential) {
            // With positions the proxy's position stands for its planes.
            const double depth = positions ? glm::dot(row.direction, proxy.position - proxy.goal) : row.depth;
            rows_.push_back({.proxy = index,
                             .patch = add_patch(proxy.contacts.plane[row.plane].touched,
                                                {proxy.position, row.direction}, bodies, model),
                             .plane = row.plane,
                             .direction = row.direction,
                             .depth = depth,
                             .goal_speed = glm::dot(row.direction, proxy.goal_velocity)});
            ++normals;
        }
    }
    // At an edge, and where a light contact comes and goes, another plane may press before the step has passed. Nothing
    // is coupled that the proxy has not met: surfaces meet it by continuous detection alone.
    const std::size_t pressed = normals;
    const bool met = pressed > 0 || was_pressed_[index] != 0;
    for (std::size_t k = proxy.contacts.count; met && k < proxy.planes.count && !positions; ++k) {
        const SurfacePlane& plane = proxy.planes.plane[k];
        rows_.push_back({.proxy = index,
                         .patch = add_patch(plane.touched, {proxy.position, plane.normal}, bodies, model),
                         .plane = static_cast<std::uint32_t>(k),
                         .direction = plane.normal,
                         .depth = plane.offset - glm::dot(plane.normal, proxy.free_position),
                         .goal_speed = glm::dot(plane.normal, proxy.goal_velocity)});
        ++normals;
    }
    if (rows.empty() || (pressed == rows.size() && !positions)) {
        return;
    }
    // Tangents, with positions also without friction: from the goal to the point that sticks.
    const std::uint32_t patch = add_mean_patch(proxy, first_patch);
    const std::array<Vec3, 2> tangents = contact_tangents(proxy.contacts.plane[0].normal);
    for (std::size_t t = 0; t < tangents.size(); ++t) {
        const double depth = positions ? glm::dot(tangents[t], proxy.position - proxy.goal) : rows[pressed + t].depth;
        rows_.push_back({.proxy = index,
                         .patch = patch,
                         .normal = false,
                         .direction = tangents[t],
                         .depth = depth,
                         .goal_speed = glm::dot(tangents[t], proxy.goal_velocity)});
    }
    const double coefficient = proxy.friction.slides ? step_.contact.dynamic_friction : step_.contact.static_friction;
    friction_.push_back({.first_normal = first_row,
                         .normals = static_cast<std::uint16_t>(normals),
                         .coefficient = positions ? kStuck : coefficient});
}

/// Eq. 4.1: the particles that take a force at the touched point, along a line.
std::uint32_t ContactCoupling::add_patch(const SurfacePoint& touched, const Line& line, const Bodies& bodies,
                                         const ParticleModel& model) {
    Patch patch{.begin = static_cast<std::uint32_t>(pressed_.size())};
    const std::size_t first = bodies.bodies[touched.object].first_particle;
    // Leave room for the corners of all later rows.
    const std::size_t later = (kMaxNormals - 1 - normal_patches_++) * PressureMask::kCornerParticles;
    const std::size_t room = pressed_.capacity() / 2 - pressed_of_normals_ - later;
    const std::span<const PressedParticle> under = bodies.masks[touched.object].center_on(touched, room);
    pressed_of_normals_ += under.size();
    for (const PressedParticle& p : under) {
        const std::size_t i = first + p.particle;
        pressed_.push_back({.particle = static_cast<std::uint32_t>(i),
                            .weight = p.weight,
                            .inverse_mass = model.pinned[i] != 0 ? 0.0 : 1.0 / model.mass[i]});
        patch.reference += p.weight * model.position[i];
    }
    patch.end = static_cast<std::uint32_t>(pressed_.size());
    if (bodies.masks[touched.object].vertices_are_particles()) {
        centre_on(line, model, patch);
    }
    patches_.push_back(patch);
    return static_cast<std::uint32_t>(patches_.size() - 1);
}

/// Changes the weights of a patch, by up to half, such that its centre lies on the line or near it: the force then
/// turns a sheet as one along the line does. The mask knows the rest shape only, and folds and borders shift its
/// centre.
void ContactCoupling::centre_on(const Line& line, const ParticleModel& model, Patch& patch) noexcept {
    // W_i (1 - a . t_i), with the offsets t_i across the line from the centre; a from the second moments M.
    const auto across = [&](const Vec3& v) { return v - glm::dot(v, line.direction) * line.direction; };
    const auto offset = [&](const Pressed& p) { return across(model.position[p.particle] - patch.reference); };
    Mat3 moments = Mat3(0.0);
    for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
        const Vec3 t = offset(pressed_[p]);
        moments += pressed_[p].weight * glm::outerProduct(t, t);
    }
    const double spread = moments[0][0] + moments[1][1] + moments[2][2];
    if (!(spread > 0.0)) {
        return;
    }
    // Regular along the line, and where all particles lie on another line.
    moments += spread * (glm::outerProduct(line.direction, line.direction) + Mat3(kLeastSpread));
    Vec3 a = glm::inverse(moments) * across(patch.reference - line.point);
    double most = 0.0;
    for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
        most = std::max(most, std::abs(glm::dot(a, offset(pressed_[p]))));
    }
    a /= std::max(most / kMostShift, 1.0);
    Vec3 centre(0.0);
    for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
        pressed_[p].weight *= 1.0 - glm::dot(a, offset(pressed_[p]));
        centre += pressed_[p].weight * model.position[pressed_[p].particle];
    }
    patch.reference = centre;
}

/// Mean of the patches of a proxy's contacts, weighted by their shares of the normal force, for its tangents.
std::uint32_t ContactCoupling::add_mean_patch(const ToolProxy& proxy, std::uint32_t first_patch) {
    if (proxy.contacts.count == 1) {
        return first_patch;
    }
    double sum = 0.0;
    for (std::size_t k = 0; k < proxy.contacts.count; ++k) {
        sum += proxy.friction.share[k];
    }
    Patch mean{.begin = static_cast<std::uint32_t>(pressed_.size())};
    for (std::size_t k = 0; k < proxy.contacts.count; ++k) {
        // Even shares if friction has not divided the force.
        const double share = sum > 0.0 ? proxy.friction.share[k] / sum : 1.0 / proxy.contacts.count;
        const Patch& patch = patches_[first_patch + k];
        mean.reference += share * patch.reference;
        for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
            pressed_.push_back({pressed_[p].particle, share * pressed_[p].weight, pressed_[p].inverse_mass});
        }
    }
    mean.end = static_cast<std::uint32_t>(pressed_.size());
    patches_.push_back(mean);
    return static_cast<std::uint32_t>(patches_.size() - 1);
}

/// W_rs = d_r . C_ij d_s of the rows, m/N, at the present part of the stiffness, and the skin.
void ContactCoupling::find_tool_compliance(const ToolProxies& tool) {
    const bool positions = step_.coupling.multi_rate == MultiRate::Positions;
    const double coupling = 1.0 / (step_.gain * step_.coupling.stiffness);
    const double spring = particle_count_ * coupling;
    const Mat3 to_tool = glm::transpose(to_matrix(tool.elastic_frame()));
    tool_compliance_.resize(rows_.size());
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        const CouplingRow& a = rows_[r];
        const Vec3 direction = to_tool * a.direction;
        for (std::size_t s = 0; s <= r; ++s) {
            const CouplingRow& b = rows_[s];
            double compliance = 0.0;
            if (positions) {
                compliance = a.proxy == b.proxy ? spring * glm::dot(a.direction, b.direction) : 0.0;
            } else {
                const Mat3& between = tool.elasticity().compliance(a.proxy, b.proxy);
                compliance = glm::dot(direction, between * (to_tool * b.direction)) / step_.gain;
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
        centre += moment_arm(row.proxy) / static_cast<double>(rows_.size());
    }
    for (std::vector<double>& motion : motions_) {
        motion.resize(rows_.size());
    }
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        const Vec3& direction = rows_[r].direction;
        const Vec3 moment = glm::cross(moment_arm(rows_[r].proxy) - centre, direction);
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

/// Y P / h^2 of the patches on bodies with a material. The mean patch of a proxy may lie on several bodies.
void ContactCoupling::find_answers(ElasticBodies& elastic, double h) {
    answers_.clear();
    answering_.clear();
    for (std::size_t k = 0; k < patches_.size(); ++k) {
        Patch& patch = patches_[k];
        patch.body = {};
        patch.answer = answers_.size();
        const std::size_t first = answering_.size();
        const auto include = [&](const ParticleRange& range) {
            const bool any = patch.body.end > patch.body.begin;
            patch.body = {any ? std::min(patch.body.begin, range.begin) : range.begin,
                          std::max(patch.body.end, range.end)};
        };
        for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
            const ParticleRange body = elastic.body_of(pressed_[p].particle);
            const auto is_body = [&](const Answering& of) { return of.body.begin == body.begin; };
            if (body.end > body.begin &&
                std::none_of(answering_.begin() + static_cast<std::ptrdiff_t>(first), answering_.end(), is_body)) {
                answering_.push_back({k, body});
                include(body);
            }
        }
        if (answering_.size() == first) {
            continue;
        }
        // Particles of a body without a material answer alone, where the patch has both.
        for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
            include({pressed_[p].particle, pressed_[p].particle + 1});
        }
        answers_.resize(answers_.size() + (patch.body.end - patch.body.begin));
        for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
            const Pressed& alone = pressed_[p];
            if (elastic.body_of(alone.particle).end == 0) {
                answers_[patch.answer + (alone.particle - patch.body.begin)] += alone.weight * alone.inverse_mass;
            }
        }
    }
    for (std::size_t first = 0; first < answering_.size();) {
        // Up to four in a row of the same body, side by side.
        const ParticleRange body = answering_[first].body;
        std::size_t count = 1;
        while (count < 4 && first + count < answering_.size() && answering_[first + count].body.begin == body.begin) {
            ++count;
        }
        columns_.assign(body.end - body.begin, Row{});
        for (std::size_t k = 0; k < count; ++k) {
            const Patch& patch = patches_[answering_[first + k].patch];
            for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
                const std::uint32_t i = pressed_[p].particle;
                if (i >= body.begin && i < body.end) {
                    columns_[i - body.begin].number[k] += pressed_[p].weight;
                }
            }
        }
        elastic.respond(body, columns_);
        for (std::size_t k = 0; k < count; ++k) {
            const Patch& patch = patches_[answering_[first + k].patch];
            double* const answer = answers_.data() + patch.answer + (body.begin - patch.body.begin);
            for (std::size_t i = 0; i < columns_.size(); ++i) {
                answer[i] = columns_[i].number[k] / (h * h);
            }
        }
        first += count;
    }
}

/// p_a^T Y p_b / h^2 of two patches, 1/kg.
double ContactCoupling::overlap(const Patch& a, const Patch& b) const noexcept {
    double sum = 0.0;
    if (b.body.end > b.body.begin) {
        for (std::uint32_t p = a.begin; p < a.end; ++p) {
            const std::uint32_t i = pressed_[p].particle;
            const bool same = i >= b.body.begin && i < b.body.end;
            sum += same ? pressed_[p].weight * answers_[b.answer + (i - b.body.begin)] : 0.0;
        }
        return sum;
    }
    // scattered_ holds W_i / m_i of `a`.
    for (std::uint32_t p = b.begin; p < b.end; ++p) {
        sum += pressed_[p].weight * scattered_[pressed_[p].particle];
    }
    return sum;
}

/// P^T Y P / h^2 of the rows without turning, 1/kg.
void ContactCoupling::find_body_compliance() {
    shape_compliance_.resize(rows_.size());
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        // W_i / m_i of the row's patch, by particle.
        const Patch& a = patches_[rows_[r].patch];
        for (std::uint32_t p = a.begin; p < a.end; ++p) {
            scattered_[pressed_[p].particle] += pressed_[p].weight * pressed_[p].inverse_mass;
        }
        for (std::size_t s = 0; s <= r; ++s) {
            const double between = overlap(a, patches_[rows_[s].patch]);
            shape_compliance_.set(r, s, between * glm::dot(rows_[r].direction, rows_[s].direction));
        }
        for (std::uint32_t p = a.begin; p < a.end; ++p) {
            scattered_[pressed_[p].particle] = 0.0;
        }
    }
}

/// The free solids under the patches where they are now, and how they turn.
void ContactCoupling::find_turning(const ParticleModel& start, ElasticBodies& elastic) {
    turning_.clear();
    patch_levers_.clear();
    for (const Answering& of : answering_) {
        if (turns_[of.body.begin] == 0) {
            continue;
        }
        auto known = std::ranges::find(turning_, of.body.begin, [](const TurningBody& b) { return b.particles.begin; });
        if (known == turning_.end()) {
            turning_.push_back({.particles = of.body, .relief = {}, .change = {}});
            known = turning_.end() - 1;
            const auto answers = std::span(turning_answers_).subspan(of.body.begin, of.body.end - of.body.begin);
            known->relief.place(start, of.body, answers);
            elastic.respond(of.body, answers);
            known->relief.take_answers(start, of.body, answers);
        }
        PatchLever lever{.patch = of.patch, .body = static_cast<std::size_t>(known - turning_.begin())};
        const Patch& patch = patches_[of.patch];
        for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
            const std::uint32_t i = pressed_[p].particle;
            if (i >= of.body.begin && i < of.body.end) {
                lever.arm += pressed_[p].weight * known->relief.arm(start.position[i]);
                lever.answer += pressed_[p].weight * vector_of(turning_answers_[i]);
            }
        }
        patch_levers_.push_back(lever);
    }
}

/// P^T Y P / h^2 with what the rows turn: -alpha_s . (Q_r x d_r) + gamma_s . (r_r x d_r) of each two of them.
void ContactCoupling::add_turning(double h) {
    row_levers_.clear();
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        // Those of a patch follow one another.
        auto lever = std::ranges::lower_bound(patch_levers_, rows_[r].patch, {}, &PatchLever::patch);
        for (; lever != patch_levers_.end() && lever->patch == rows_[r].patch; ++lever) {
            const Vec3 torque = glm::cross(lever->arm, rows_[r].direction);
            const Vec3 answered = glm::cross(lever->answer, rows_[r].direction);
            row_levers_.push_back(
                {r, lever->body, torque, answered, turning_[lever->body].relief.turn_by(torque, answered, h)});
        }
    }
    body_compliance_.resize(rows_.size());
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        for (std::size_t s = 0; s <= r; ++s) {
            body_compliance_.set(r, s, shape_compliance_(r, s));
        }
    }
    for (std::size_t k = 0; k < row_levers_.size(); ++k) {
        const RowLever& of = row_levers_[k];
        for (std::size_t l = 0; l <= k; ++l) {
            const RowLever& by = row_levers_[l];
            if (of.body == by.body) {
                const double turned = glm::dot(by.turn.gamma, of.torque) - glm::dot(by.turn.alpha, of.answered);
                // Two bodies of one row have no part in common.
                body_compliance_.set(of.row, by.row, body_compliance_(of.row, by.row) + turned / (h * h));
            }
        }
    }
}

Vec3 ContactCoupling::mean_position(const Patch& patch, const MovingParticles& now) const noexcept {
    Vec3 mean(0.0);
    for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
        mean += pressed_[p].weight * vector_of(now.position[pressed_[p].particle]);
    }
    return mean;
}

void ContactCoupling::begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& /*now*/,
                            double h) {
    const StageClock::Span timed(clock_);
    projected_ = false;
    if (answered_step_ != h) {
        find_answers(elastic, h);
        find_body_compliance();
    }
    find_turning(start, elastic);
    if (answered_step_ != h || !turning_.empty()) {
        add_turning(h);
    }
    answered_step_ = h;
    add_work(start);
    for (CouplingRow& row : rows_) {
        row.applied = 0.0;
    }
}

/// Adds the work of the sub-step that has ended with the particles where they are, after collisions too, and begins the
/// next one there.
void ContactCoupling::add_work(const ParticleModel& at) noexcept {
    for (Patch& patch : patches_) {
        patch.now = patch.start;
        patch.start = Vec3(0.0);
        for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
            patch.start += pressed_[p].weight * at.position[pressed_[p].particle];
        }
    }
    for (CouplingRow& row : rows_) {
        const Patch& patch = patches_[row.patch];
        work_ += glm::dot(row.exerted, patch.start - patch.now);
        row.exerted = Vec3(0.0);
    }
    // The same for what was paid after a contact.
    if (step_.owed_force != Vec3(0.0)) {
        Vec3 point(0.0);
        for (const Pressed& p : last_pressed_) {
            point += p.weight * at.position[p.particle];
        }
        work_ += glm::dot(paid_after_contact_, point - last_point_);
        last_point_ = point;
        paid_after_contact_ = Vec3(0.0);
    }
}

void ContactCoupling::end_step(const ParticleModel& model) noexcept {
    const StageClock::Span timed(clock_);
    add_work(model);
}

/// tau = damping_time + c b of each proxy, with the depth that the last pass has led to: the mean over its planes,
/// weighted by the depths themselves.
void ContactCoupling::find_damping_times() {
    std::array<double, kMaxProxies> depths{};
    std::array<double, kMaxProxies> squares{};
    for (const CouplingRow& row : rows_) {
        if (row.normal) {
            const Patch& patch = patches_[row.patch];
            const double depth = std::max(0.0, row.depth + glm::dot(row.direction, patch.now - patch.reference));
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
        const Patch& patch = patches_[row.patch];
        const Vec3 mean = mean_position(patch, now);
        const double speed = glm::dot(row.direction, mean - patch.start) / h - row.goal_speed;
        const double depth = std::max(0.0, row.depth + glm::dot(row.direction, mean - patch.reference));
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
            block_.set(r, s, tool_compliance_(r, s) / damped + h * h * body_compliance_(r, s));
        }
    }
}

void ContactCoupling::project(const ParticleModel& start, const MovingParticles& now, double h) {
    const StageClock::Span timed(clock_);
    projected_ = true;
    for (Patch& patch : patches_) {
        patch.now = mean_position(patch, now);
    }
    find_damping_times();
    // b of each row, for the particles without the forces applied so far.
    depth_.clear();
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        const CouplingRow& row = rows_[r];
        const Patch& patch = patches_[row.patch];
        double applied = 0.0;
        for (std::size_t s = 0; s < rows_.size(); ++s) {
            applied += body_compliance_(r, s) * rows_[s].applied;
        }
        applied *= h * h;
        const double depth = row.depth + glm::dot(row.direction, patch.now - patch.reference) + applied;
        const double approach = (glm::dot(row.direction, patch.now - patch.start) + applied) / h - row.goal_speed;
        // A plane that is not reached does not damp.
        const double damping_time = row.normal && depth <= 0.0 ? 0.0 : row.damping_time;
        depth_.push_back((depth + damping_time * approach) / (1.0 + row.damping_time / h));
    }
    build_block(h);
    // The forces of the sub-step, and the change since the last pass: x <- x - Y P dl.
    solver_.solve(block_, depth_, friction_);
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        const double force = solver_.force()[r];
        press(patches_[rows_[r].patch], -h * h * (force - rows_[r].applied) * rows_[r].direction, now.position);
        rows_[r].applied = force;
    }
    move_elastic_bodies(start, h, now.position);
}

/// Adds Y P / h^2 times `by`, h^2 times a force on the particles under the mask; on a body with a material once
/// move_elastic_bodies() is called.
void ContactCoupling::press(Patch& patch, const Vec3& by, Row* position) const noexcept {
    if (patch.body.end > patch.body.begin) {
        patch.change += by;
    } else {
        displace(patch, by, position);
    }
}

void ContactCoupling::move_elastic_bodies(const ParticleModel& start, double h, Row* position) noexcept {
    for (const PatchLever& lever : patch_levers_) {
        const Vec3 force = patches_[lever.patch].change / (h * h);
        TurningBody& body = turning_[lever.body];
        body.change += body.relief.turn_by(glm::cross(lever.arm, force), glm::cross(lever.answer, force), h);
    }
    for (TurningBody& body : turning_) {
        const bool turns = body.change.alpha != Vec3(0.0) || body.change.gamma != Vec3(0.0);
        for (std::uint32_t i = body.particles.begin; turns && i < body.particles.end; ++i) {
            add_vector(position[i], InertiaRelief::displacement(body.change, body.relief.arm(start.position[i]),
                                                                vector_of(turning_answers_[i])));
        }
        body.change = {};
    }
    for (Patch& patch : patches_) {
        for (std::size_t i = patch.body.begin; patch.change != Vec3(0.0) && i < patch.body.end; ++i) {
            const Vec3 moved = answers_[patch.answer + (i - patch.body.begin)] * patch.change;
            position[i].number[0] += moved.x;
            position[i].number[1] += moved.y;
            position[i].number[2] += moved.z;
        }
        patch.change = Vec3(0.0);
    }
}

/// Adds `by` W_i / m_i to the particles under the mask.
void ContactCoupling::displace(const Patch& patch, const Vec3& by, Row* position) const noexcept {
    displace(std::span(pressed_).subspan(patch.begin, patch.end - patch.begin), by, position);
}

void ContactCoupling::displace(std::span<const Pressed> particles, const Vec3& by, Row* position) noexcept {
    if (by == Vec3(0.0)) {
        return;
    }
    for (const Pressed& p : particles) {
        const Vec3 moved = (p.weight * p.inverse_mass) * by;
        Row& at = position[p.particle];
        at.number[0] += moved.x;
        at.number[1] += moved.y;
        at.number[2] += moved.z;
    }
}

/// m, g_i - p: from the hip to the point at which the springs of a proxy pull.
Vec3 ContactCoupling::moment_arm(std::uint32_t proxy) const noexcept {
    const ToolProxy& p = proxies_[proxy];
    return (step_.coupling.multi_rate == MultiRate::Positions ? p.goal : p.free_position) - hip_;
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
            press(patches_[row.patch], -h * h * part, position);
            displace(patches_[row.patch], -h * h * part, pushed);
            row.exerted += part;
            paid_.force += h * part;
            paid_.torque += h * glm::cross(moment_arm(row.proxy), part);
        }
    }
    move_elastic_bodies(start, h, position);
}

/// Adds the owed force to the particles that were pressed last, unless it pulls.
void ContactCoupling::pay_after_contact(double h, Row* position, Row* pushed) {
    if (!(glm::dot(step_.owed_force, last_push_) > 0.0)) {
        return;
    }
    displace(last_pressed_, -h * h * step_.owed_force, position);
    displace(last_pressed_, -h * h * step_.owed_force, pushed);
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
        displace(patches_[row.patch], -h * h * row.applied * row.direction, now.pushed);
        row.impulse += h * row.applied;
        row.exerted = row.applied * row.direction;
    }
    add_leads(now, h);
    pay(start, h, now.position, now.pushed);
}

double ContactCoupling::normal_force(std::size_t proxy, std::size_t plane) const noexcept {
    for (const CouplingRow& row : rows_) {
        if (row.normal && row.proxy == proxy && row.plane == plane) {
            return row.impulse / step_.length;
        }
    }
    return 0.0;
}

CoupledForce ContactCoupling::force() const noexcept {
    CoupledForce result;
    // F = sum l d, T = sum (g_i - p) x l d.
    for (const CouplingRow& row : rows_) {
        const Vec3 force = (row.impulse / step_.length) * row.direction;
        result.force += force;
        result.torque += glm::cross(moment_arm(row.proxy), force);
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
