#include "app/moment_store.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/gtc/quaternion.hpp>
#include <span>
#include <type_traits>
#include <utility>

namespace haptic::sim {
namespace {

constexpr double kPlaces = 65535.0;
constexpr double kTurns = 32767.0;
// Of the interval: a moment that comes so much early is in time.
constexpr double kEarly = 1e-6;

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
    void put_places(std::span<const Vec3> places) {
        if (places.empty()) {
            return;
        }
        Vec3 low = places.front();
        Vec3 high = low;
        for (const Vec3& p : places) {
            low = glm::min(low, p);
            high = glm::max(high, p);
        }
        put(low);
        put(high);
        for (const Vec3& p : places) {
            for (int k = 0; k < 3; ++k) {
                const double size = high[k] - low[k];
                const double part = size > 0.0 ? (p[k] - low[k]) / size : 0.0;
                put(static_cast<std::uint16_t>(std::lround(part * kPlaces)));
            }
        }
    }
    void put_turns(std::span<const Quat> turns) {
        for (const Quat& q : turns) {
            for (const double c : {q.w, q.x, q.y, q.z}) {
                put(static_cast<std::int16_t>(std::lround(std::clamp(c, -1.0, 1.0) * kTurns)));
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

/// In the order of a Packer.
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
    void get_places(std::span<Vec3> places) {
        if (places.empty()) {
            return;
        }
        const auto low = get<Vec3>();
        const auto high = get<Vec3>();
        for (Vec3& p : places) {
            for (int k = 0; k < 3; ++k) {
                p[k] = low[k] + (high[k] - low[k]) * (get<std::uint16_t>() / kPlaces);
            }
        }
    }
    void get_turns(std::span<Quat> turns) {
        for (Quat& q : turns) {
            q.w = get<std::int16_t>() / kTurns;
            q.x = get<std::int16_t>() / kTurns;
            q.y = get<std::int16_t>() / kTurns;
            q.z = get<std::int16_t>() / kTurns;
            q = glm::normalize(q);
        }
    }

  private:
    std::span<const std::byte> bytes_;
    std::size_t at_ = 0;
};

/// What is kept as it is, in one order for both ways.
template <class Moment, class Visit>
void visit_rest(Moment& moment, Visit&& visit) {
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
    visit(moment.squeezed);
}

}  // namespace

MomentStore::MomentStore(const view::SceneDescription& scene, std::size_t most_bytes) : most_bytes_(most_bytes) {
    for (const view::BodyDescription& body : scene.bodies) {
        body_vertices_.push_back(body.vertices);
        body_particles_.push_back(body.particles);
    }
}

bool MomentStore::wants(double time) const {
    const std::lock_guard lock(mutex_);
    return moments_.empty() || time >= moments_.back().time + interval_ * (1.0 - kEarly);
}

void MomentStore::add(const view::SceneSnapshot& moment) {
    Packer packer;
    visit_rest(moment, [&](const auto& value) { packer.put(value); });
    packer.put_all(moment.proxies);
    packer.put_all(moment.planes);
    std::size_t at = 0;
    for (const std::size_t count : body_vertices_) {
        packer.put_places(std::span(moment.vertices).subspan(at, count));
        at += count;
    }
    at = 0;
    for (const std::size_t count : body_particles_) {
        packer.put_places(std::span(moment.particles).subspan(at, count));
        at += count;
    }
    packer.put_turns(moment.orientations);
    packer.put_places(moment.tool_vertices);
    Packed packed{moment.time, packer.take()};
    const std::lock_guard lock(mutex_);
    bytes_ += packed.bytes.size();
    moments_.push_back(std::move(packed));
    if (bytes_ > most_bytes_) {
        thin_out();
    }
}

void MomentStore::thin_out() {
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
    visit_rest(out, [&](auto& value) { unpacker.get(value); });
    unpacker.get_all(out.proxies);
    unpacker.get_all(out.planes);
    std::size_t at = 0;
    for (const std::size_t count : body_vertices_) {
        unpacker.get_places(std::span(out.vertices).subspan(at, count));
        at += count;
    }
    at = 0;
    for (const std::size_t count : body_particles_) {
        unpacker.get_places(std::span(out.particles).subspan(at, count));
        at += count;
    }
    unpacker.get_turns(out.orientations);
    unpacker.get_places(out.tool_vertices);
    return true;
}

double MomentStore::beside(double time, std::int64_t by) const {
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
