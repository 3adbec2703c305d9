#include "dynamics/constraint_batches.hpp"

#include <algorithm>
#include <stdexcept>
#include <tuple>
#include <utility>

namespace haptic::sim {
namespace {

constexpr std::size_t kMaxColours = 4096;

/// Greedy graph colouring: each constraint, in order, gets the first colour that none of its particles has.
/// @return the constraints of each colour
template <class Particles>
std::vector<std::vector<std::uint32_t>> colour(std::size_t constraints, std::size_t particles,
                                               const Particles& for_each_particle) {
    std::vector<std::vector<bool>> used;  // per colour, per particle
    std::vector<std::vector<std::uint32_t>> of_colour;
    for (std::uint32_t c = 0; c < constraints; ++c) {
        std::size_t choice = 0;
        // First colour that no particle of the constraint has yet.
        for (; choice < used.size(); ++choice) {
            bool clash = false;
            for_each_particle(c, [&](std::uint32_t p) { clash = clash || used[choice][p]; });
            if (!clash) {
                break;
            }
        }
        // All colours clash: open another one.
        if (choice == used.size()) {
            if (choice == kMaxColours) {
                throw std::invalid_argument("solver: a particle is in too many constraints");
            }
            used.emplace_back(particles, false);
            of_colour.emplace_back();
        }
        for_each_particle(c, [&](std::uint32_t p) { used[choice][p] = true; });
        of_colour[choice].push_back(c);
    }
    return of_colour;
}

/// Colours the given subset of the model's links.
std::vector<std::vector<std::uint32_t>> colour_links(const ParticleModel& model,
                                                     const std::vector<std::uint32_t>& links) {
    auto colours = colour(links.size(), model.size(), [&](std::uint32_t l, const auto& visit) {
        visit(model.links[links[l]].first);
        visit(model.links[links[l]].second);
    });
    for (std::vector<std::uint32_t>& same : colours) {
        for (std::uint32_t& l : same) {
            l = links[l];
        }
    }
    return colours;
}

/// The offset by which constraints refer to a particle.
std::uint32_t offset_of(std::uint32_t particle) {
    return particle * static_cast<std::uint32_t>(kDoublesPerRow);
}

}  // namespace

ConstraintBatches::ConstraintBatches(const ParticleModel& model, std::size_t lanes)
    : lanes_(lanes), particles_((model.size() + lanes - 1) / lanes * lanes) {
    // Links with a compliance are springs: projected by XPBD, in double.
    std::vector<std::uint32_t> links;
    std::vector<std::uint32_t> springs;
    for (std::uint32_t l = 0; l < model.links.size(); ++l) {
        (model.links[l].compliance > 0.0 ? springs : links).push_back(l);
    }
    // Links, then springs, then groups, each in colours and whole vectors of lanes.
    batch_links(model, links);
    batch_springs(model, springs);
    batch_groups(model);
    link_start_.resize(3 * first_.size());
    group_start_.resize(3 * member_.size());
}

void ConstraintBatches::begin_substep(double h) noexcept {
    if (h != step_) {
        scale_compliances(h);
    }
    // Multipliers of XPBD start at 0 in each sub-step.
    std::fill(spring_.lambda.begin(), spring_.lambda.end(), 0.0);
    std::fill(shift_.begin(), shift_.end(), 0.0f);
}

void ConstraintBatches::scale_compliances(double h) noexcept {
    // XPBD: s = compliance / h^2, and the gain stiffness / (w_a + w_b + s) of springs.
    const double inverse_square = 1.0 / (h * h);
    for (std::size_t k = 0; k < spring_.scaled_compliance.size(); ++k) {
        const double scaled_compliance = spring_.compliance[k] * inverse_square;
        const double inverse_mass_sum = spring_.first_inverse_mass[k] + spring_.second_inverse_mass[k];
        spring_.scaled_compliance[k] = scaled_compliance;
        spring_.gain[k] = inverse_mass_sum > 0.0 ? spring_.stiffness[k] / (inverse_mass_sum + scaled_compliance) : 0.0;
    }
    // Groups: the factor stiffness / (1 + s) is applied once here instead of per member.
    for (std::size_t k = 0; k < scaled_compliance_.size(); ++k) {
        const double scaled_compliance = compliance_[k] * inverse_square;
        scaled_compliance_[k] = static_cast<float>(scaled_compliance);
        stiffness_[k] = static_cast<float>(rigid_stiffness_[k] / (1.0 + scaled_compliance));
    }
    step_ = h;
}

void ConstraintBatches::batch_links(const ParticleModel& model, const std::vector<std::uint32_t>& links) {
    // Links of one colour share no particle, so one vector projects several at once.
    const auto colours = colour_links(model, links);
    link_colours_ += colours.size();
    // Each end's share of the correction, stiffness * w / (w_a + w_b).
    const auto add = [&](std::uint32_t a, std::uint32_t b, double length, double share_a, double share_b) {
        first_.push_back(offset_of(a));
        second_.push_back(offset_of(b));
        rest_length_.push_back(static_cast<float>(length));
        first_share_.push_back(static_cast<float>(share_a));
        second_share_.push_back(static_cast<float>(share_b));
    };
    for (const std::vector<std::uint32_t>& same : colours) {
        for (const std::uint32_t l : same) {
            const Link& link = model.links[l];
            const double a = inverse_mass(model, link.first);
            const double b = inverse_mass(model, link.second);
            // Links between two pinned particles do nothing.
            if (a + b > 0.0) {
                add(link.first, link.second, link.rest_length, link.stiffness * a / (a + b),
                    link.stiffness * b / (a + b));
            }
        }
        // Fill the last vector of the colour with links of a padding particle to itself.
        while (first_.size() % lanes_ != 0) {
            const std::uint32_t padding = padding_particle(first_.size() % lanes_);
            add(padding, padding, 0.0, 0.0, 0.0);
        }
    }
}

void ConstraintBatches::batch_springs(const ParticleModel& model, const std::vector<std::uint32_t>& links) {
    const auto colours = colour_links(model, links);
    link_colours_ += colours.size();
    // Unlike rigid links, springs need both inverse masses: their gain depends on the sub-step.
    const auto add = [&](const Link& link, double a, double b) {
        spring_.first.push_back(offset_of(link.first));
        spring_.second.push_back(offset_of(link.second));
        spring_.rest_length.push_back(link.rest_length);
        spring_.first_inverse_mass.push_back(a);
        spring_.second_inverse_mass.push_back(b);
        spring_.compliance.push_back(link.compliance);
        spring_.stiffness.push_back(link.stiffness);
    };
    for (const std::vector<std::uint32_t>& same : colours) {
        for (const std::uint32_t l : same) {
            const Link& link = model.links[l];
            const double a = inverse_mass(model, link.first);
            const double b = inverse_mass(model, link.second);
            // Springs between two pinned particles do nothing.
            if (a + b > 0.0) {
                add(link, a, b);
            }
        }
        // Fill the last vector of the colour.
        while (spring_.first.size() % lanes_ != 0) {
            const std::uint32_t padding = padding_particle(spring_.first.size() % lanes_);
            add({padding, padding, 0.0, 0.0, 0.0}, 0.0, 0.0);
        }
    }
    // Filled by scale_compliances() and the kernels.
    for (LaneArray<double>* numbers : {&spring_.scaled_compliance, &spring_.gain, &spring_.lambda}) {
        numbers->resize(spring_.first.size());
    }
}

void ConstraintBatches::batch_groups(const ParticleModel& model) {
    // Groups of one colour share no particle.
    auto colours = colour(model.groups.size(), model.size(), [&](std::uint32_t g, const auto& visit) {
        for (const std::uint32_t p : model.groups[g].members) {
            visit(p);
        }
    });
    group_colours_ = colours.size();
    // Compliant groups last, then by decreasing size. Not std::stable_partition: that of libstdc++ 12 does not compile
    // without warnings with clang.
    const auto is_compliant = [&](std::uint32_t g) { return model.groups[g].compliance > 0.0; };
    const auto sort = [&](std::vector<std::uint32_t>& groups) {
        std::sort(groups.begin(), groups.end(), [&](std::uint32_t a, std::uint32_t b) {
            return std::tuple(is_compliant(a), model.groups[b].members.size(), a) <
                   std::tuple(is_compliant(b), model.groups[a].members.size(), b);
        });
    };
    // Fill the lanes across colours: each group goes to the first round with room that comes after the rounds of all
    // groups that share a particle with it and precede it. Their relative order stays, so no bit changes.
    std::vector<std::vector<std::uint32_t>> rounds;
    std::vector<std::size_t> next(model.size(), 0);  // per particle: first round after those that use it
    for (std::vector<std::uint32_t>& same : colours) {
        sort(same);
        for (const std::uint32_t g : same) {
            // First round after those of the group's particles.
            std::size_t round = 0;
            for (const std::uint32_t p : model.groups[g].members) {
                round = std::max(round, next[p]);
            }
            // A round holds as many groups as the widest vectors have lanes.
            while (round < rounds.size() && rounds[round].size() == kMaxLanes) {
                ++round;
            }
            rounds.resize(std::max(rounds.size(), round + 1));
            rounds[round].push_back(g);
            // Later groups with these particles must come after this round.
            for (const std::uint32_t p : model.groups[g].members) {
                next[p] = round + 1;
            }
        }
    }
    // Rigid and compliant groups of a round go to separate batches, since their kernels differ.
    for (std::vector<std::uint32_t>& round : rounds) {
        sort(round);
        const auto compliant = std::find_if(round.begin(), round.end(), is_compliant);
        batch_same_kind(model, {round.begin(), compliant});
        batch_same_kind(model, {compliant, round.end()});
    }
    // Only compliant groups accumulate displacements.
    if (std::any_of(run_.begin(), run_.end(), [](const GroupRun& run) { return run.compliant; })) {
        shift_.resize(rest_offset_.size());
    }
}

void ConstraintBatches::batch_same_kind(const ParticleModel& model, const std::vector<std::uint32_t>& groups) {
    const std::size_t first_batch = batch_.size();
    for (std::size_t first = 0; first < groups.size(); first += lanes_) {
        add_batch(model, groups, first);
    }
    divide_into_runs(first_batch, !groups.empty() && model.groups[groups[0]].compliance > 0.0);
}

void ConstraintBatches::divide_into_runs(std::size_t first_batch, bool compliant) {
    for (std::size_t b = first_batch; b < batch_.size(); ++b) {
        // Open another run when this one is full or needs other masks.
        GroupRun* last = b == first_batch ? nullptr : &run_.back();
        if (last == nullptr || last->batches == kMaxBatchesInRun || last->uneven != is_uneven(b)) {
            last = &run_.emplace_back(GroupRun{static_cast<std::uint32_t>(b), 0, is_uneven(b), compliant});
        }
        ++last->batches;
    }
}

bool ConstraintBatches::is_uneven(std::size_t batch) const noexcept {
    // Uneven: a lane with a group has a slot without a free member. Lanes without a group do not count.
    const std::size_t first = batch_[batch].first_slot * lanes_;
    for (std::size_t i = 0; i < batch_[batch].slots * lanes_; ++i) {
        const bool group_exists = inverse_mass_[batch * lanes_ + i % lanes_] > 0.0f;
        if (group_exists && member_is_free_[first + i] == 0) {
            return true;
        }
    }
    return false;
}

void ConstraintBatches::add_batch(const ParticleModel& model, const std::vector<std::uint32_t>& groups,
                                  std::size_t first) {
    const std::size_t slots = model.groups[groups[first]].members.size();  // sorted: none is larger
    batch_.push_back({static_cast<std::uint32_t>(member_.size() / lanes_), static_cast<std::uint32_t>(slots)});
    // Start with every slot empty: padding particle, weight 0, not free.
    const std::size_t begin = member_.size();
    for (std::size_t i = 0; i < slots * lanes_; ++i) {
        member_.push_back(offset_of(padding_particle(i % lanes_)));
    }
    weight_.resize(member_.size(), 0.0f);
    member_is_free_.resize(member_.size(), 0);
    rest_offset_.resize(3 * member_.size(), 0.0f);
    // Lanes beyond the last group stay empty.
    for (std::size_t lane = 0; lane < lanes_; ++lane) {
        const Group* group = first + lane < groups.size() ? &model.groups[groups[first + lane]] : nullptr;
        add_group(model, group, begin + lane);
    }
}

void ConstraintBatches::add_group(const ParticleModel& model, const Group* group, std::size_t first_member) {
    // Empty lane: a group without members, which moves nothing.
    if (group == nullptr) {
        centre_.push_back(offset_of(padding_particle(first_member % lanes_)));
        rigid_stiffness_.push_back(0.0);
        stiffness_.push_back(0.0f);
        compliance_.push_back(0.0);
        scaled_compliance_.push_back(0.0f);
        inverse_mass_.push_back(0.0f);
        centre_is_free_.push_back(0);
        return;
    }
    // Constants of the group. Its stiffness is that without compliance until scale_compliances().
    double mass = 0.0;
    for (const std::uint32_t p : group->members) {
        mass += model.mass[p];
    }
    centre_.push_back(offset_of(group->centre));
    rigid_stiffness_.push_back(group->stiffness);
    stiffness_.push_back(static_cast<float>(group->stiffness));
    compliance_.push_back(group->compliance);
    scaled_compliance_.push_back(0.0f);
    inverse_mass_.push_back(static_cast<float>(1.0 / mass));
    centre_is_free_.push_back(model.pinned[group->centre] != 0 ? 0 : 1);
    // Members of one lane are `lanes_` apart.
    std::size_t at = first_member;
    for (const std::uint32_t p : group->members) {
        member_[at] = offset_of(p);
        weight_[at] = static_cast<float>(model.mass[p] / mass);
        member_is_free_[at] = model.pinned[p] != 0 ? 0 : 1;
        at += lanes_;
    }
    set_rest_offsets(model, first_member, group->members.size());
}

void ConstraintBatches::set_rest_offsets(const ParticleModel& model, std::size_t first_member,
                                         std::size_t members) noexcept {
    const auto particle = [&](std::size_t slot) { return member_[first_member + slot * lanes_] / kDoublesPerRow; };
    // Rest centroid, weighted by mass.
    double mass = 0.0;
    Vec3 centroid(0.0);
    for (std::size_t slot = 0; slot < members; ++slot) {
        mass += model.mass[particle(slot)];
        centroid += model.mass[particle(slot)] * model.rest_position[particle(slot)];
    }
    centroid /= mass;
    // Layout [slot][x, y, z][lane].
    const std::size_t lane = first_member % lanes_;
    std::size_t at = first_member;
    for (std::size_t slot = 0; slot < members; ++slot) {
        const Vec3 offset = model.rest_position[particle(slot)] - centroid;
        float* to = &rest_offset_[3 * (at - lane) + lane];
        to[0] = static_cast<float>(offset.x);
        to[lanes_] = static_cast<float>(offset.y);
        to[2 * lanes_] = static_cast<float>(offset.z);
        at += lanes_;
    }
}

LinkBatches ConstraintBatches::links() noexcept {
    return {.count = first_.size() / lanes_,
            .first = first_.data(),
            .second = second_.data(),
            .rest_length = rest_length_.data(),
            .first_share = first_share_.data(),
            .second_share = second_share_.data(),
            .start = link_start_.data()};
}

SpringBatches ConstraintBatches::springs() noexcept {
    return {.count = spring_.first.size() / lanes_,
            .first = spring_.first.data(),
            .second = spring_.second.data(),
            .rest_length = spring_.rest_length.data(),
            .first_inverse_mass = spring_.first_inverse_mass.data(),
            .second_inverse_mass = spring_.second_inverse_mass.data(),
            .scaled_compliance = spring_.scaled_compliance.data(),
            .gain = spring_.gain.data(),
            .lambda = spring_.lambda.data()};
}

GroupBatches ConstraintBatches::groups() noexcept {
    return {.runs = run_.size(),
            .run = run_.data(),
            .max_slots = max_slots(),
            .batches = batch_.size(),
            .batch = batch_.data(),
            .centre = centre_.data(),
            .stiffness = stiffness_.data(),
            .scaled_compliance = scaled_compliance_.data(),
            .inverse_mass = inverse_mass_.data(),
            .centre_is_free = centre_is_free_.data(),
            .member = member_.data(),
            .weight = weight_.data(),
            .rest_offset = rest_offset_.data(),
            .start = group_start_.data(),
            .member_is_free = member_is_free_.data(),
            .shift = shift_.data()};
}

std::size_t ConstraintBatches::max_slots() const noexcept {
    std::size_t max = 0;
    for (const GroupBatch& batch : batch_) {
        max = std::max<std::size_t>(max, batch.slots);
    }
    return max;
}

}  // namespace haptic::sim
