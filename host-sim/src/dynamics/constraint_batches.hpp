// Constraint batches: a model's constraints in the order and layout in which the kernels project them.
//
// Constraints of one colour share no particle, so their order changes no bit of the result. Groups of several colours
// are collected in rounds, which share no particle either, sorted by size, to make batches even, and divided into
// batches of one constraint per lane.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

#include "haptic/sim/particles.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {

/// Aligns arrays to cache lines, so that no vector register is loaded across two.
template <class T>
struct CacheLineAllocator {
    using value_type = T;
    static constexpr std::align_val_t kAlignment{64};

    CacheLineAllocator() = default;
    template <class U>
    explicit CacheLineAllocator(const CacheLineAllocator<U>& /*other*/) noexcept {}
    [[nodiscard]] T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), kAlignment)); }
    void deallocate(T* memory, std::size_t /*n*/) noexcept { ::operator delete(memory, kAlignment); }
    friend bool operator==(const CacheLineAllocator& /*a*/, const CacheLineAllocator& /*b*/) noexcept { return true; }
};

template <class T>
using LaneArray = std::vector<T, CacheLineAllocator<T>>;

class ConstraintBatches {
  public:
    /// Precondition: model.check() has passed. Throws std::invalid_argument if a particle is in too many constraints.
    ConstraintBatches(const ParticleModel& model, std::size_t lanes);

    /// Resets the multipliers of compliant constraints and scales their compliances for a sub-step of length h, s.
    void begin_substep(double h) noexcept;

    /// Number of particles, rounded up to whole vectors.
    [[nodiscard]] std::size_t whole_vectors() const noexcept { return particles_; }
    /// whole_vectors() plus one padding particle per lane.
    [[nodiscard]] std::size_t padded_particles() const noexcept { return particles_ + lanes_; }
    [[nodiscard]] LinkBatches links() noexcept;
    /// The scaled compliances and gains are valid after begin_substep().
    [[nodiscard]] SpringBatches springs() noexcept;
    [[nodiscard]] GroupBatches groups() noexcept;
    [[nodiscard]] std::size_t link_colours() const noexcept { return link_colours_; }
    [[nodiscard]] std::size_t group_colours() const noexcept { return group_colours_; }
    /// Slots of the largest batch of groups.
    [[nodiscard]] std::size_t max_slots() const noexcept;

  private:
    void scale_compliances(double h) noexcept;
    void batch_links(const ParticleModel& model, const std::vector<std::uint32_t>& links);
    void batch_springs(const ParticleModel& model, const std::vector<std::uint32_t>& links);
    void batch_groups(const ParticleModel& model);
    void add_batch(const ParticleModel& model, const std::vector<std::uint32_t>& groups, std::size_t first);
    /// Batches `groups` in their order; all have a compliance or none has.
    void batch_same_kind(const ParticleModel& model, const std::vector<std::uint32_t>& groups);
    void divide_into_runs(std::size_t first_batch, bool compliant);
    [[nodiscard]] bool is_uneven(std::size_t batch) const noexcept;
    /// The lane's padding particle. One per lane, since stores of several lanes to one address would wait for each
    /// other.
    [[nodiscard]] std::uint32_t padding_particle(std::size_t lane) const noexcept {
        return static_cast<std::uint32_t>(particles_ + lane);
    }
    void add_group(const ParticleModel& model, const Group* group, std::size_t first_member);
    /// Writes the rest offsets of the group whose first member is at this index.
    void set_rest_offsets(const ParticleModel& model, std::size_t first_member, std::size_t members) noexcept;

    std::size_t lanes_;
    std::size_t particles_;
    double step_ = 0.0;  // s, sub-step for which the compliances are scaled
    std::size_t link_colours_ = 0;
    std::size_t group_colours_ = 0;

    // Storage of LinkBatches and GroupBatches.
    LaneArray<std::uint32_t> first_;
    LaneArray<std::uint32_t> second_;
    LaneArray<float> rest_length_;
    LaneArray<float> first_share_;
    LaneArray<float> second_share_;
    LaneArray<float> link_start_;
    struct {
        LaneArray<std::uint32_t> first;
        LaneArray<std::uint32_t> second;
        LaneArray<double> rest_length;
        LaneArray<double> first_inverse_mass;
        LaneArray<double> second_inverse_mass;
        LaneArray<double> compliance;
        LaneArray<double> stiffness;
        LaneArray<double> scaled_compliance;
        LaneArray<double> gain;
        LaneArray<double> lambda;
    } spring_;
    std::vector<GroupRun> run_;
    std::vector<GroupBatch> batch_;
    LaneArray<std::uint32_t> centre_;
    LaneArray<float> stiffness_;
    std::vector<double> compliance_;
    std::vector<double> rigid_stiffness_;  // stiffness before the compliance is applied
    LaneArray<float> scaled_compliance_;
    LaneArray<float> inverse_mass_;
    LaneArray<std::int32_t> centre_is_free_;
    LaneArray<std::uint32_t> member_;
    LaneArray<float> weight_;
    LaneArray<float> rest_offset_;
    LaneArray<float> group_start_;
    LaneArray<std::int32_t> member_is_free_;
    LaneArray<float> shift_;  // empty without compliant groups
};

/// m r^2 / 5, kg m^2: weight of a ball's orientation in the moment matrix.
[[nodiscard]] inline double spin_mass(const ParticleModel& model, std::size_t particle) {
    return 0.2 * model.mass[particle] * model.radius[particle] * model.radius[particle];
}

}  // namespace haptic::sim
