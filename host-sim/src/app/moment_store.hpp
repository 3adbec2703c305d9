// The moments of a run that is watched again, in bounded memory.
//
// One thread keeps moments, another looks them up. Each is packed: places to 1/65535 of the box that a body is in,
// turns to 1/32767, so that a moment of the cloth takes 22 kB, and a minute at 60 a second 80 MB. When the memory is
// used up, every second moment is let go, and from there on half as many are kept: what is watched becomes coarser,
// never shorter.
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
    static constexpr double kRate = 60.0;  // moments a second, at first
    static constexpr std::size_t kMostBytes = std::size_t{512} << 20;

    explicit MomentStore(const view::SceneDescription& scene, std::size_t most_bytes = kMostBytes);

    /// Whether a moment at this time, s, would be kept.
    [[nodiscard]] bool wants(double time) const;
    /// Keeps one that is later than all before, as it is but for `run`.
    void add(const view::SceneSnapshot& moment);

    /// The last moment not after a time, s, or the first; false while there is none. `out` is sized as for the scene.
    bool find(double time, view::SceneSnapshot& out) const;
    /// s: the moment that is so many after the one at a time, or before it; the first or last, where there are not as
    /// many.
    [[nodiscard]] double beside(double time, std::int64_t by) const;
    [[nodiscard]] std::size_t size() const;
    [[nodiscard]] std::size_t bytes() const;

  private:
    struct Packed {
        double time = 0.0;
        std::vector<std::byte> bytes;
    };

    [[nodiscard]] std::size_t index_of(double time) const;
    void thin_out();

    std::vector<std::size_t> body_vertices_;   // of each body
    std::vector<std::size_t> body_particles_;  // likewise
    std::size_t most_bytes_;
    mutable std::mutex mutex_;  // of what follows
    std::vector<Packed> moments_;
    std::size_t bytes_ = 0;
    double interval_ = 1.0 / kRate;  // s
};

}  // namespace haptic::sim
