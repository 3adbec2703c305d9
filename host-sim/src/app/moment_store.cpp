#include "app/moment_store.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/gtc/quaternion.hpp>
#include <span>
#include <type_traits>
#include <utility>

#include "simd/aabb.hpp"

namespace haptic::sim {
namespace {

constexpr double kPositionSteps = 65535.0;
constexpr double kRotationSteps = 32767.0;
// Part of the interval by which a snapshot may be early, for rounding.
constexpr double kTimeTolerance = 1e-6;

/// Appends values to a byte string.
class Packer {
  public:
    template <class T>
    void value(const T& value) {
        static_assert(std::is_trivially_copyable_v<T>);
        const std::size_t at = bytes_.size();
        bytes_.resize(at + sizeof(T));
        std::memcpy(&bytes_[at], &value, sizeof(T));
    }
    template <class T>
    void array(const std::vector<T>& values) {
        value(static_cast<std::uint32_t>(values.size()));
        for (const T& element : values) {
            value(element);
        }
    }
    void positions(std::span<const Vec3> positions) {
        if (positions.empty()) {
            return;
        }
        const auto [low, high] = aabb_of(positions);
        value(low);
        value(high);
        for (const Vec3& p : positions) {
            for (int k = 0; k < 3; ++k) {
                const double size = high[k] - low[k];
                const double part = size > 0.0 ? (p[k] - low[k]) / size : 0.0;
                value(static_cast<std::uint16_t>(std::lround(part * kPositionSteps)));
            }
        }
    }
    void orientations(std::span<const Quat> orientations) {
        for (const Quat& q : orientations) {
            for (const double c : {q.w, q.x, q.y, q.z}) {
                value(static_cast<std::int16_t>(std::lround(std::clamp(c, -1.0, 1.0) * kRotationSteps)));
            }
        }
    }
    [[nodiscard]] std::vector<std::byte> take() {
        bytes_.shrink_to_fit();
        return std::move(bytes_);
    }

  private:
    std::vector<std::byte> bytes_;
};

/// Reads values in the order in which a Packer wrote them.
class Unpacker {
  public:
    explicit Unpacker(std::span<const std::byte> bytes) : bytes_(bytes) {}

    template <class T>
    T get() {
        T value{};
        std::memcpy(&value, &bytes_[at_], sizeof(T));
        at_ += sizeof(T);
        return value;
    }
    template <class T>
    void value(T& value) {
        value = get<T>();
    }
    template <class T>
    void array(std::vector<T>& values) {
        values.resize(get<std::uint32_t>());
        for (T& element : values) {
            value(element);
        }
    }
    void positions(std::span<Vec3> positions) {
        if (positions.empty()) {
            return;
        }
        const auto low = get<Vec3>();
        const auto high = get<Vec3>();
        for (Vec3& p : positions) {
            for (int k = 0; k < 3; ++k) {
                p[k] = low[k] + (high[k] - low[k]) * (get<std::uint16_t>() / kPositionSteps);
            }
        }
    }
    void orientations(std::span<Quat> orientations) {
        for (Quat& q : orientations) {
            q.w = get<std::int16_t>() / kRotationSteps;
            q.x = get<std::int16_t>() / kRotationSteps;
            q.y = get<std::int16_t>() / kRotationSteps;
            q.z = get<std::int16_t>() / kRotationSteps;
            q = glm::normalize(q);
        }
    }

  private:
    std::span<const std::byte> bytes_;
    std::size_t at_ = 0;
};

/// Packs or unpacks a snapshot but for its time: exact members, then quantised ones, with the vertices and particles of
/// each body in a box of their own.
template <class Moment, class Bytes>
void transfer(Moment& moment, Bytes& bytes, const std::vector<std::size_t>& body_vertices,
              const std::vector<std::size_t>& body_particles) {
    bytes.value(moment.step);
    bytes.value(moment.tool);
    bytes.value(moment.hip);
    bytes.value(moment.force);
    bytes.value(moment.torque);
    bytes.value(moment.hand_force);
    bytes.value(moment.hand_torque);
    bytes.value(moment.curl);
    bytes.value(moment.depth);
    bytes.value(moment.in_contact);
    bytes.value(moment.overconstrained);
    bytes.array(moment.proxies);
    bytes.array(moment.planes);
    bytes.array(moment.forces);
    const auto positions_of = [&](auto& positions, const std::vector<std::size_t>& counts) {
        std::size_t at = 0;
        for (const std::size_t count : counts) {
            bytes.positions(std::span(positions).subspan(at, count));
            at += count;
        }
    };
    positions_of(moment.vertices, body_vertices);
    positions_of(moment.particles, body_particles);
    bytes.orientations(moment.orientations);
    bytes.positions(moment.tool_vertices);
}

}  // namespace

MomentStore::MomentStore(const view::SceneDescription& scene, std::size_t max_bytes) : max_bytes_(max_bytes) {
    for (const view::BodyDescription& body : scene.bodies) {
        body_vertices_.push_back(body.vertices);
        body_particles_.push_back(body.particles);
    }
}

bool MomentStore::wants(double time) const {
    const std::lock_guard lock(mutex_);
    return moments_.empty() || time >= moments_.back().time + interval_ * (1.0 - kTimeTolerance);
}

void MomentStore::add(const view::SceneSnapshot& moment) {
    Packer packer;
    transfer(moment, packer, body_vertices_, body_particles_);
    Packed packed{moment.time, packer.take()};
    // Packing needs no lock; adding does.
    const std::lock_guard lock(mutex_);
    bytes_ += packed.bytes.size();
    moments_.push_back(std::move(packed));
    if (bytes_ > max_bytes_) {
        thin_out();
    }
}

void MomentStore::thin_out() {
    // Keep the even ones in place.
    std::size_t kept = 0;
    bytes_ = 0;
    for (std::size_t k = 0; k < moments_.size(); k += 2, ++kept) {
        if (kept != k) {
            moments_[kept] = std::move(moments_[k]);
        }
        bytes_ += moments_[kept].bytes.size();
    }
    moments_.resize(kept);
    interval_ *= 2.0;
}

std::size_t MomentStore::index_of(double time) const {
    const auto after = std::upper_bound(moments_.begin(), moments_.end(), time,
                                        [](double t, const Packed& moment) { return t < moment.time; });
    const auto index = static_cast<std::size_t>(after - moments_.begin());
    return index == 0 ? 0 : index - 1;
}

bool MomentStore::find(double time, view::SceneSnapshot& out) const {
    const std::lock_guard lock(mutex_);
    if (moments_.empty()) {
        return false;
    }
    const Packed& packed = moments_[index_of(time)];
    Unpacker unpacker(packed.bytes);
    out.time = packed.time;
    transfer(out, unpacker, body_vertices_, body_particles_);
    return true;
}

double MomentStore::time_of_neighbour(double time, std::int64_t by) const {
    const std::lock_guard lock(mutex_);
    if (moments_.empty()) {
        return 0.0;
    }
    const auto last = static_cast<std::int64_t>(moments_.size()) - 1;
    const std::int64_t at = std::clamp<std::int64_t>(static_cast<std::int64_t>(index_of(time)) + by, 0, last);
    return moments_[static_cast<std::size_t>(at)].time;
}

std::size_t MomentStore::size() const {
    const std::lock_guard lock(mutex_);
    return moments_.size();
}

std::size_t MomentStore::bytes() const {
    const std::lock_guard lock(mutex_);
    return bytes_;
}

}  // namespace haptic::sim
