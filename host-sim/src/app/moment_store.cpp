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
    void put(const T& value) {
        static_assert(std::is_trivially_copyable_v<T>);
        const std::size_t at = bytes_.size();
        bytes_.resize(at + sizeof(T));
        std::memcpy(&bytes_[at], &value, sizeof(T));
    }
    template <class T>
    void put_all(const std::vector<T>& values) {
        put(static_cast<std::uint32_t>(values.size()));
        for (const T& value : values) {
            put(value);
        }
    }
    void put_positions(std::span<const Vec3> positions) {
        if (positions.empty()) {
            return;
        }
        const auto [low, high] = aabb_of(positions);
        put(low);
        put(high);
        for (const Vec3& p : positions) {
            for (int k = 0; k < 3; ++k) {
                const double size = high[k] - low[k];
                const double part = size > 0.0 ? (p[k] - low[k]) / size : 0.0;
                put(static_cast<std::uint16_t>(std::lround(part * kPositionSteps)));
            }
        }
    }
    void put_orientations(std::span<const Quat> orientations) {
        for (const Quat& q : orientations) {
            for (const double c : {q.w, q.x, q.y, q.z}) {
                put(static_cast<std::int16_t>(std::lround(std::clamp(c, -1.0, 1.0) * kRotationSteps)));
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
    void get(T& value) {
        value = get<T>();
    }
    template <class T>
    void get_all(std::vector<T>& values) {
        values.resize(get<std::uint32_t>());
        for (T& value : values) {
            get(value);
        }
    }
    void get_positions(std::span<Vec3> positions) {
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
    void get_orientations(std::span<Quat> orientations) {
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

/// Members stored without loss, in the same order for packing and unpacking.
template <class Moment, class Visit>
void visit_unpacked(Moment& moment, Visit&& visit) {
    visit(moment.step);
    visit(moment.tool);
    visit(moment.hip);
    visit(moment.force);
    visit(moment.torque);
    visit(moment.hand_force);
    visit(moment.hand_torque);
    visit(moment.curl);
    visit(moment.depth);
    visit(moment.in_contact);
    visit(moment.overconstrained);
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
    // Exact members, then quantised ones: vertices and particles per body, each in its own box.
    Packer packer;
    visit_unpacked(moment, [&](const auto& value) { packer.put(value); });
    packer.put_all(moment.proxies);
    packer.put_all(moment.planes);
    std::size_t at = 0;
    for (const std::size_t count : body_vertices_) {
        packer.put_positions(std::span(moment.vertices).subspan(at, count));
        at += count;
    }
    at = 0;
    for (const std::size_t count : body_particles_) {
        packer.put_positions(std::span(moment.particles).subspan(at, count));
        at += count;
    }
    packer.put_orientations(moment.orientations);
    packer.put_positions(moment.tool_vertices);
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
    visit_unpacked(out, [&](auto& value) { unpacker.get(value); });
    unpacker.get_all(out.proxies);
    unpacker.get_all(out.planes);
    std::size_t at = 0;
    for (const std::size_t count : body_vertices_) {
        unpacker.get_positions(std::span(out.vertices).subspan(at, count));
        at += count;
    }
    at = 0;
    for (const std::size_t count : body_particles_) {
        unpacker.get_positions(std::span(out.particles).subspan(at, count));
        at += count;
    }
    unpacker.get_orientations(out.orientations);
    unpacker.get_positions(out.tool_vertices);
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
