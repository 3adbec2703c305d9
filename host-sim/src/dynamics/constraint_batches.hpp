// A model's constraints in the order and the batches in which they are projected.
//
// Constraints of one colour share no particle, so their order among themselves changes no bit of the result: groups of
// a colour are sorted by size, that batches are even, and a batch is a colour's next so many.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

#include <haptic/sim/particles.hpp>
#include "simd/projection.hpp"

namespace haptic::sim {

/// Puts the first element on a cache line's border, so that no vector lies across two.
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
    /// The model has been checked. Throws std::invalid_argument if a particle is in too many constraints.
    ConstraintBatches(const ParticleModel& model, std::size_t lanes);

    /// Forgets what compliant constraints have pulled, and makes them as soft as a sub-step of length h, s, sees them.
    void begin(double h) noexcept;

    /// Groups and links as the particles are at rest now.
    void set_rest_shape(const ParticleModel& model) noexcept;

    /// The number of particles, filled up to whole vectors.
    [[nodiscard]] std::size_t bodies() const noexcept { return bodies_; }
    /// With those that stand for nobody, one for each lane.
    [[nodiscard]] std::size_t all_bodies() const noexcept { return bodies_ + lanes_; }
    [[nodiscard]] LinkBatches links() noexcept;
    /// Its softness and gain, and those of compliant groups, are for begin() to write.
    [[nodiscard]] SpringBatches springs() noexcept;
    [[nodiscard]] GroupBatches groups() noexcept;
    [[nodiscard]] std::size_t link_colours() const noexcept { return link_colours_; }
    [[nodiscard]] std::size_t group_colours() const noexcept { return group_colours_; }
    /// Slots of the largest batch.
    [[nodiscard]] std::size_t most_slots() const noexcept;

  private:
    void soften(double h) noexcept;
    void batch_links(const ParticleModel& model, const std::vector<std::uint32_t>& links);
    void batch_springs(const ParticleModel& model, const std::vector<std::uint32_t>& links);
    void batch_groups(const ParticleModel& model);
    void add_batch(const ParticleModel& model, const std::vector<std::uint32_t>& groups, std::size_t first);
    /// All with a compliance, or all without.
    void batch_alike(const ParticleModel& model, const std::vector<std::uint32_t>& groups);
    void divide_into_runs(std::size_t first_batch, bool compliant);
    [[nodiscard]] bool uneven(std::size_t batch) const noexcept;
    /// Of a lane's own, since lanes that write to the same place wait for one another.
    [[nodiscard]] std::uint32_t nobody_in(std::size_t lane) const noexcept {
        return static_cast<std::uint32_t>(bodies_ + lane);
    }
    void add_group(const ParticleModel& model, const Group* group, std::size_t first_member);
    /// The rest shape of the group whose first member is there, and how many members it has.
    void set_rest_offsets(const ParticleModel& model, std::size_t first_member, std::size_t members) noexcept;

    std::size_t lanes_;
    std::size_t bodies_;
    double step_ = 0.0;  // s, that softness holds for
    std::size_t link_colours_ = 0;
    std::size_t group_colours_ = 0;

    // What LinkBatches and GroupBatches point to.
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
        LaneArray<double> softness;
        LaneArray<double> gain;
        LaneArray<double> pull;
    } spring_;
    std::vector<GroupRun> run_;
    std::vector<GroupBatch> batch_;
    LaneArray<std::uint32_t> centre_;
    LaneArray<float> stiffness_;
    std::vector<double> compliance_;
    std::vector<double> rigid_stiffness_;  // without softness
    LaneArray<float> softness_;
    LaneArray<float> inverse_mass_;
    LaneArray<std::int32_t> centre_is_free_;
    LaneArray<std::uint32_t> member_;
    LaneArray<float> weight_;
    LaneArray<float> rest_offset_;
    LaneArray<float> group_start_;
    LaneArray<std::int32_t> member_is_free_;
    LaneArray<float> shift_;  // empty without compliant groups
};

/// m r^2 / 5, kg m^2: what weights the orientation of a ball in the moment matrix.
[[nodiscard]] inline double spin_mass(const ParticleModel& model, std::size_t particle) {
    return 0.2 * model.mass[particle] * model.radius[particle] * model.radius[particle];
}

}  // namespace haptic::sim
