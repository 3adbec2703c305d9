// Moment store: snapshots of a replayed run in bounded memory.
//
// One thread adds snapshots while another looks them up. They are packed: positions to 1/65535 of the bounding box of a
// body, quaternions to 1/32767. A snapshot of the cloth takes 22 kB, a minute at 60 per second 80 MB. When the memory
// is used up, every second snapshot is dropped and the rate is halved: the replay becomes coarser, never shorter.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

#include "view/snapshot.hpp"

namespace haptic::sim {

class MomentStore {
  public:
    static constexpr double kRate = 60.0;  // snapshots per second, initially
    static constexpr std::size_t kMaxBytes = std::size_t{512} << 20;

    explicit MomentStore(const view::SceneDescription& scene, std::size_t max_bytes = kMaxBytes);

    /// Whether a snapshot at this time, s, is due.
    [[nodiscard]] bool wants(double time) const;
    /// Adds a snapshot later than all others. Its member `run` is not stored.
    void add(const view::SceneSnapshot& moment);

    /// Unpacks the last snapshot not after a time, s, or the first one. False if the store is empty. `out` must be
    /// sized for the scene.
    bool find(double time, view::SceneSnapshot& out) const;
    /// Time, s, of the snapshot `by` places after the one at `time` (before it, if negative), limited to the first and
    /// last.
    [[nodiscard]] double time_of_neighbour(double time, std::int64_t by) const;
    [[nodiscard]] std::size_t size() const;
    [[nodiscard]] std::size_t bytes() const;

  private:
    struct Packed {
        double time = 0.0;
        std::vector<std::byte> bytes;
    };

    [[nodiscard]] std::size_t index_of(double time) const;
    void thin_out();

    std::vector<std::size_t> body_vertices_;   // per body
    std::vector<std::size_t> body_particles_;  // per body
    std::size_t max_bytes_;
    mutable std::mutex mutex_;  // guards the members below
    std::vector<Packed> moments_;
    std::size_t bytes_ = 0;
    double interval_ = 1.0 / kRate;  // s, between snapshots
};

}  // namespace haptic::sim
