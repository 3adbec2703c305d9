#include "tool/pressed_patches.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numeric>
#include <utility>

#include "dynamics/model_bodies.hpp"
#include "dynamics/rotation.hpp"
#include "dynamics/rows.hpp"
#include "haptic/sim/elasticity.hpp"

namespace haptic::sim {
namespace {

// Most patches but mean ones: one for each plane of each proxy.
constexpr std::size_t kMaxAdded = kMaxProxies * kMaxSurfacePlanes;
// Most particles under all masks together. Rows beyond it press on the corners of the touched triangle alone.
constexpr std::size_t kMaxPressed = std::size_t{1} << 18;
// Most answers of particles to patches without an allocation.
constexpr std::size_t kMaxAnswers = std::size_t{1} << 22;
// Of a patch's spread: that across which it counts as a line.
constexpr double kLeastSpread = 1e-6;
// Largest part by which that changes a weight: a mask on the rim of a sheet must not shrink to a point.
constexpr double kMostShift = 0.5;

// Elements that have less than this part of their volume, as flat ones, count as unstrained.
constexpr double kLeastVolume = 0.125;

}  // namespace

PressedPatches::PressedPatches(const ParticleModel& model) : scattered_(model.size(), 0.0) {
    // Twice, for mean patches.
    pressed_.reserve(2 * std::min(kMaxPressed, kMaxAdded * std::max(model.size(), PressureMask::kCornerParticles)));
    patches_.reserve(kMaxAdded + kMaxProxies);
    rows_.reserve(kMaxContactRows);
    overlaps_.reserve(kMaxContactRows);
    if (model.elasticity.elements.empty()) {
        return;
    }
    columns_.reserve(model.size());
    answering_.reserve(kMaxAdded + 3 * kMaxProxies);
    answers_.reserve(std::min(kMaxAnswers, (kMaxAdded + kMaxProxies) * model.size()));
    turns_.resize(model.size(), 0);
    std::vector<ParticleRange> solids = solids_of(model);
    element_of_.resize(model.size(), kNone);
    gradient_of_.resize(model.size(), Vec3(0.0));
    members_.reserve(model.size());
    is_member_.resize(model.size(), 0);
    for (std::uint32_t e = 0; e < model.elasticity.elements.size(); ++e) {
        const std::uint32_t centre = model.elasticity.elements[e].centre;
        if (std::ranges::any_of(solids, [&](const ParticleRange& s) { return centre >= s.begin && centre < s.end; })) {
            element_of_[centre] = e;
        }
    }
    std::erase_if(solids, [&](const ParticleRange& solid) { return !has_no_pinned(model, solid); });
    for (const ParticleRange& solid : solids) {
        std::fill_n(turns_.begin() + solid.begin, solid.end - solid.begin, std::uint8_t{1});
    }
    turning_.reserve(solids.size());
    patch_levers_.reserve(answering_.capacity());
    row_levers_.reserve(kMaxAdded + 6 * kMaxProxies);
}

void PressedPatches::clear() noexcept {
    pressed_.clear();
    patches_.clear();
    rows_.clear();
    added_patches_ = 0;
    added_particles_ = 0;
    answered_step_ = 0.0;
}

void PressedPatches::begin(ElasticBodies& elastic, double h) {
    elastic_ = &elastic;
    is_new_ = answered_step_ != h;
    if (is_new_) {
        find_answers(elastic, h);
        find_body_compliance();
        list_turning();
    }
    for (const TurningBody& body : turning_) {
        elastic.forget_turning(body.particles);
        elastic.find_turning_in_step(body.particles);
    }
    answered_step_ = h;
}

void PressedPatches::find_turning(const ParticleModel& start, double h) {
    for (TurningBody& body : turning_) {
        body.by_forces = &elastic_->turning(body.particles, start);
    }
    find_levers(start);
    if (is_new_ || !turning_.empty()) {
        add_turning(h);
    }
}

void PressedPatches::advance_places(const ParticleModel& model) noexcept {
    for (Patch& patch : patches_) {
        patch.places.now = patch.places.start;
        patch.places.start = place_in(model, patch);
    }
}

/// Changes the weights of a patch, by up to half, such that its centre lies on the line or near it: the force then
/// turns a sheet as one along the line does. The mask knows the rest shape only, and folds and borders shift its
/// centre.
void PressedPatches::centre_on(const Line& line, const ParticleModel& model, Patch& patch) noexcept {
    // W_i (1 - a . t_i), with the offsets t_i across the line from the centre; a from the second moments M.
    const auto across = [&](const Vec3& v) { return v - glm::dot(v, line.direction) * line.direction; };
    const auto offset = [&](const Pressed& p) { return across(model.position[p.particle] - patch.places.reference); };
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
    Vec3 a = glm::inverse(moments) * across(patch.places.reference - line.point);
    double most = 0.0;
    for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
        most = std::max(most, std::abs(glm::dot(a, offset(pressed_[p]))));
    }
    a /= std::max(most / kMostShift, 1.0);
    for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
        pressed_[p].weight *= 1.0 - glm::dot(a, offset(pressed_[p]));
    }
    patch.places.reference = place_in(model, patch);
}

/// Adds the other members of the elements about the particles of a patch, and all gradients. False: there are none, or
/// no room for them.
bool PressedPatches::add_elements(const ParticleModel& model, std::size_t room, Patch& patch) {
    for (const Pressed& p : particles_of(patch)) {
        if (element_of_[p.particle] == kNone) {
            continue;
        }
        const ElasticElement& element = model.elasticity.elements[element_of_[p.particle]];
        const Mat3 rotation = to_matrix(model.orientation[p.particle]);
        for (std::size_t k = 0; k < element.members.size(); ++k) {
            const std::uint32_t member = element.members[k];
            gradient_of_[member] += p.weight * (rotation * element.gradient[k]);
            if (std::exchange(is_member_[member], std::uint8_t{1}) == 0) {
                members_.push_back(member);
            }
        }
    }
    const bool fits = !members_.empty() && members_.size() <= room;
    for (std::uint32_t p = patch.begin; p < patch.end && fits; ++p) {
        pressed_[p].gradient = gradient_of_[pressed_[p].particle];
        is_member_[pressed_[p].particle] = 0;
    }
    for (const std::uint32_t i : members_) {
        if (std::exchange(is_member_[i], std::uint8_t{0}) != 0 && fits) {
            pressed_.push_back(
                {.particle = i, .weight = 0.0, .inverse_mass = inverse_mass(model, i), .gradient = gradient_of_[i]});
            ++added_particles_;
        }
        gradient_of_[i] = Vec3(0.0);
    }
    members_.clear();
    patch.end = static_cast<std::uint32_t>(pressed_.size());
    return fits;
}

/// Leads the mean of a patch with gradients to where it is touched, but for its depth along the line.
void PressedPatches::lead_to(const Line& line, const ParticleModel& model, Patch& patch) noexcept {
    // The mean moves by `moves` a with the weights a . g.
    Mat3 moves(0.0);
    for (const Pressed& p : particles_of(patch)) {
        moves += glm::outerProduct(model.position[p.particle] - patch.places.reference, p.gradient);
    }
    const Mat3 arm_of = glm::determinant(moves) > kLeastVolume ? glm::inverse(moves) : Mat3(1.0);
    const Vec3 away = line.point - patch.places.reference;
    const Vec3 deep = glm::dot(away, line.direction) * line.direction;
    patch.depth = arm_of * deep;
    const Vec3 across = arm_of * (away - deep);
    for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
        pressed_[p].weight += glm::dot(across, pressed_[p].gradient);
    }
    patch.places.reference = place_in(model, patch);
}

std::uint32_t PressedPatches::add(const SurfacePoint& touched, const Line& line, const Bodies& bodies,
                                  const ParticleModel& model) {
    Patch patch{.begin = static_cast<std::uint32_t>(pressed_.size())};
    const std::size_t first = bodies.bodies[touched.object].first_particle;
    // Leave room for the corners of all later rows.
    const std::size_t later = (kMaxAdded - 1 - added_patches_++) * PressureMask::kCornerParticles;
    const std::size_t room = max_particles() - added_particles_ - later;
    const std::span<const PressedParticle> under = bodies.masks[touched.object].center_on(touched, room);
    added_particles_ += under.size();
    for (const PressedParticle& p : under) {
        const std::size_t i = first + p.particle;
        pressed_.push_back(
            {.particle = static_cast<std::uint32_t>(i), .weight = p.weight, .inverse_mass = inverse_mass(model, i)});
    }
    patch.end = static_cast<std::uint32_t>(pressed_.size());
    patch.places.reference = place_in(model, patch);
    if (bodies.masks[touched.object].vertices_are_particles()) {
        centre_on(line, model, patch);
    } else if (!element_of_.empty() && add_elements(model, room - under.size(), patch)) {
        lead_to(line, model, patch);
    }
    patches_.push_back(patch);
    return static_cast<std::uint32_t>(patches_.size() - 1);
}

std::uint32_t PressedPatches::add_mean(std::uint32_t first, std::span<const double> shares,
                                       const ParticleModel& model) {
    if (shares.size() == 1 && patches_[first].depth == Vec3(0.0)) {
        return first;
    }
    const double sum = std::accumulate(shares.begin(), shares.end(), 0.0);
    Patch mean{.begin = static_cast<std::uint32_t>(pressed_.size())};
    for (std::size_t k = 0; k < shares.size(); ++k) {
        const double share = sum > 0.0 ? shares[k] / sum : 1.0 / static_cast<double>(shares.size());
        const Patch& patch = patches_[first + k];
        for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
            const Pressed& of = pressed_[p];
            const double weight = of.weight + glm::dot(patch.depth, of.gradient);
            pressed_.push_back({.particle = of.particle, .weight = share * weight, .inverse_mass = of.inverse_mass});
        }
    }
    mean.end = static_cast<std::uint32_t>(pressed_.size());
    mean.places.reference = place_in(model, mean);
    patches_.push_back(mean);
    return static_cast<std::uint32_t>(patches_.size() - 1);
}

/// Y P / h^2 of the patches on bodies with a material. The mean patch of a proxy may lie on several bodies.
void PressedPatches::find_answers(ElasticBodies& elastic, double h) {
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
double PressedPatches::overlap(const Patch& a, const Patch& b) const noexcept {
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

/// overlap() of a row's patch with those of all rows up to it. Rows on the same patch follow one another.
void PressedPatches::find_overlaps(std::size_t row) noexcept {
    const Patch& a = patches_[rows_[row].patch];
    for (std::uint32_t p = a.begin; p < a.end; ++p) {
        scattered_[pressed_[p].particle] += pressed_[p].weight * pressed_[p].inverse_mass;
    }
    for (std::size_t s = 0; s <= row; ++s) {
        overlaps_[s] = is_of_last_patch(s) ? overlaps_[s - 1] : overlap(a, patches_[rows_[s].patch]);
    }
    for (std::uint32_t p = a.begin; p < a.end; ++p) {
        scattered_[pressed_[p].particle] = 0.0;
    }
}

/// P^T Y P / h^2 of the rows without turning, 1/kg.
void PressedPatches::find_body_compliance() {
    shape_compliance_.resize(rows_.size());
    overlaps_.resize(rows_.size());
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        if (is_of_last_patch(r)) {
            overlaps_[r] = overlaps_[r - 1];
        } else {
            find_overlaps(r);
        }
        for (std::size_t s = 0; s <= r; ++s) {
            shape_compliance_.set(r, s, overlaps_[s] * glm::dot(rows_[r].direction, rows_[s].direction));
        }
    }
}

/// The free solids under the patches, each once.
void PressedPatches::list_turning() {
    turning_.clear();
    for (const Answering& of : answering_) {
        if (turns_[of.body.begin] != 0 && body_that_turns(of.body) == turning_.size()) {
            turning_.push_back({.particles = of.body, .by_forces = nullptr, .change = {}});
        }
    }
}

/// Its index in turning_; their number if it is none of these.
std::size_t PressedPatches::body_that_turns(const ParticleRange& body) const noexcept {
    const auto first = [](const TurningBody& b) { return b.particles.begin; };
    return static_cast<std::size_t>(std::ranges::find(turning_, body.begin, first) - turning_.begin());
}

/// What the patches have on the bodies that turn, where these are now.
void PressedPatches::find_levers(const ParticleModel& start) {
    patch_levers_.clear();
    for (const Answering& of : answering_) {
        if (turns_[of.body.begin] == 0) {
            continue;
        }
        PatchLever lever{.patch = of.patch, .body = body_that_turns(of.body)};
        const ElasticBodies::Turning& turning = *turning_[lever.body].by_forces;
        const Patch& patch = patches_[of.patch];
        for (std::uint32_t p = patch.begin; p < patch.end; ++p) {
            const std::uint32_t i = pressed_[p].particle;
            if (i >= of.body.begin && i < of.body.end) {
                lever.arm += pressed_[p].weight * turning.relief.arm(start.position[i]);
                lever.answer += pressed_[p].weight * vector_of(turning.answers[i - of.body.begin]);
            }
        }
        patch_levers_.push_back(lever);
    }
}

/// P^T Y P / h^2 with what the rows turn: -alpha_s . (Q_r x d_r) + gamma_s . (r_r x d_r) of each two of them.
void PressedPatches::add_turning(double h) {
    row_levers_.clear();
    for (std::size_t r = 0; r < rows_.size(); ++r) {
        // Those of a patch follow one another.
        auto lever = std::ranges::lower_bound(patch_levers_, rows_[r].patch, {}, &PatchLever::patch);
        for (; lever != patch_levers_.end() && lever->patch == rows_[r].patch; ++lever) {
            const Vec3 torque = glm::cross(lever->arm, rows_[r].direction);
            const Vec3 answered = glm::cross(lever->answer, rows_[r].direction);
            row_levers_.push_back({r, lever->body, torque, answered,
                                   turning_[lever->body].by_forces->relief.turn_by(torque, answered, h)});
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

Vec3 PressedPatches::place_of(std::uint32_t patch, const Row* position) const noexcept {
    return mean_of(particles(patch), [&](std::size_t i) { return vector_of(position[i]); });
}

void PressedPatches::update_now(const Row* position) noexcept {
    for (std::uint32_t k = 0; k < patches_.size(); ++k) {
        patches_[k].places.now = place_of(k, position);
    }
}

void PressedPatches::press(std::uint32_t on, const Vec3& by, Row* position) noexcept {
    if (Patch& patch = patches_[on]; patch.body.end > patch.body.begin) {
        patch.change += by;
    } else {
        displace(on, by, position);
    }
}

void PressedPatches::move_elastic_bodies(const ParticleModel& start, double h, Row* position) noexcept {
    for (const PatchLever& lever : patch_levers_) {
        const Vec3 force = patches_[lever.patch].change / (h * h);
        TurningBody& body = turning_[lever.body];
        body.change += body.by_forces->relief.turn_by(glm::cross(lever.arm, force), glm::cross(lever.answer, force), h);
    }
    for (TurningBody& body : turning_) {
        const bool turns = body.change.alpha != Vec3(0.0) || body.change.gamma != Vec3(0.0);
        for (std::uint32_t i = body.particles.begin; turns && i < body.particles.end; ++i) {
            const InertiaRelief& relief = body.by_forces->relief;
            const Row& answer = body.by_forces->answers[i - body.particles.begin];
            add_vector(position[i],
                       InertiaRelief::displacement(body.change, relief.arm(start.position[i]), vector_of(answer)));
        }
        body.change = {};
    }
    for (Patch& patch : patches_) {
        for (std::size_t i = patch.body.begin; patch.change != Vec3(0.0) && i < patch.body.end; ++i) {
            add_vector(position[i], answers_[patch.answer + (i - patch.body.begin)] * patch.change);
        }
        patch.change = Vec3(0.0);
    }
}

void PressedPatches::displace(std::uint32_t on, const Vec3& by, Row* position) const noexcept {
    displace(particles(on), by, position);
}

void PressedPatches::displace(std::span<const Pressed> particles, const Vec3& by, Row* position) noexcept {
    if (by == Vec3(0.0)) {
        return;
    }
    for (const Pressed& p : particles) {
        add_vector(position[p.particle], (p.weight * p.inverse_mass) * by);
    }
}

}  // namespace haptic::sim
