// Independent decoder of binary messages, from PROTOCOL.md alone, without the encoder's code.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <vector>

#include "haptic/types.hpp"

namespace haptic::sim::view::test {

/// Reads numbers sequentially; throws at the end.
class Reader {
  public:
    explicit Reader(std::span<const std::byte> bytes) : bytes_(bytes) {}

    template <class Number>
    Number take() {
        Number number{};
        const auto raw = skip(sizeof(Number));
        std::memcpy(&number, raw.data(), sizeof(Number));
        return number;
    }
    std::uint32_t u32() { return take<std::uint32_t>(); }
    float f32() { return take<float>(); }
    Vec3 vec3() {
        const double x = f32();
        const double y = f32();
        return {x, y, static_cast<double>(f32())};
    }
    std::span<const std::byte> skip(std::size_t length) {
        if (length > bytes_.size()) {
            throw std::out_of_range("the message ends too soon");
        }
        const auto skipped = bytes_.first(length);
        bytes_ = bytes_.subspan(length);
        return skipped;
    }
    [[nodiscard]] bool at_end() const noexcept { return bytes_.empty(); }

  private:
    std::span<const std::byte> bytes_;
};

struct Part {
    std::uint32_t kind = 0;
    std::uint32_t index = 0;
    std::uint32_t count = 0;
    std::vector<std::byte> bytes;
};

struct Frame {
    std::uint32_t scene = 0;
    double time = 0.0;
    double step = 0.0;
    std::uint32_t flags = 0;
    std::vector<Part> parts;

    /// Null if there is none.
    [[nodiscard]] const Part* part(std::uint32_t kind, std::uint32_t index = 0) const {
        for (const Part& part : parts) {
            if (part.kind == kind && part.index == index) {
                return &part;
            }
        }
        return nullptr;
    }
};

inline Frame read_frame(std::span<const std::byte> message) {
    Reader reader(message);
    if (reader.u32() != 2) {
        throw std::invalid_argument("no frame");
    }
    Frame frame;
    frame.scene = reader.u32();
    frame.time = reader.take<double>();
    frame.step = reader.take<double>();
    frame.flags = reader.u32();
    frame.parts.resize(reader.u32());
    for (Part& part : frame.parts) {
        part.kind = reader.u32();
        part.index = reader.u32();
        part.count = reader.u32();
        const std::uint32_t length = reader.u32();
        if (length % 4 != 0) {
            throw std::invalid_argument("a part is not aligned");
        }
        const auto bytes = reader.skip(length);
        part.bytes.assign(bytes.begin(), bytes.end());
    }
    if (!reader.at_end()) {
        throw std::invalid_argument("something follows the last part");
    }
    return frame;
}

struct Surface {
    Vec3 size{0.0};
    std::vector<Vec3> positions;
    std::vector<Vec3> normals;  // unit
};

/// @source Cigolle et al. 2014, listing 2
inline Vec3 from_octahedral(double u, double v) {
    Vec3 n(u, v, 1.0 - std::abs(u) - std::abs(v));
    if (n.z < 0.0) {
        n = Vec3((1.0 - std::abs(v)) * (u >= 0.0 ? 1.0 : -1.0), (1.0 - std::abs(u)) * (v >= 0.0 ? 1.0 : -1.0), n.z);
    }
    return n / std::sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
}

inline Surface read_surface(const Part& part) {
    Reader reader(part.bytes);
    Surface surface;
    const Vec3 origin = reader.vec3();
    surface.size = reader.vec3();
    for (std::uint32_t k = 0; k < part.count; ++k) {
        const double x = reader.take<std::uint16_t>() / 65535.0;
        const double y = reader.take<std::uint16_t>() / 65535.0;
        const double z = reader.take<std::uint16_t>() / 65535.0;
        surface.positions.push_back(origin + surface.size * Vec3(x, y, z));
        const double u = reader.take<std::int8_t>() / 127.0;
        const double v = reader.take<std::int8_t>() / 127.0;
        surface.normals.push_back(from_octahedral(u, v));
    }
    if (!reader.at_end()) {
        throw std::invalid_argument("something follows the last vertex");
    }
    return surface;
}

}  // namespace haptic::sim::view::test
