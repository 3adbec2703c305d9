// Message encoder: descriptions and snapshots of a scene as messages for viewers (host-sim/page/PROTOCOL.md). Pure
// functions.
//
// A snapshot is encoded once for all viewers, in parts with headers of their own. A viewer is sent a header and the
// parts whose version it does not have yet. A part gets a new version when its content has changed since it was last
// encoded.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "view/snapshot.hpp"

namespace haptic::sim::view {

using Bytes = std::vector<std::byte>;

/// Kinds of binary messages, and of the parts of a frame, as sent.
enum class MessageKind : std::uint32_t { Geometry = 1, Frame = 2, Samples = 3 };
enum class PartKind : std::uint32_t {
    BodySurface = 1,
    ToolSurface = 2,
    Particles = 3,
    Proxies = 4,
    Planes = 5,
    Hand = 6,
    Parameters = 7,
    ContactForces = 8
};

/// The message "scene". `scene` numbers the descriptions of one view.
[[nodiscard]] std::string scene_message(const SceneDescription& description, std::uint32_t scene, bool control);

/// The message "geometry", which follows "scene".
[[nodiscard]] Bytes geometry_message(const SceneDescription& description, std::uint32_t scene);

/// The message "samples". The samples are consecutive; `dropped` samples are missing before the first.
[[nodiscard]] Bytes samples_message(std::span<const StepSample> samples, std::uint32_t scene, std::uint32_t dropped);

/// The triangles without repetitions: of those with the same three vertices only the first is kept. A double-faced
/// surface is drawn once, and the normals of its faces do not cancel.
[[nodiscard]] std::vector<Triangle> single_faces(std::span<const Triangle> triangles);

/// Octahedral encoding of a unit vector as two numbers, v / 127. A vector without a direction becomes (0, 0, 1).
/// @source Z. Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", 2014
[[nodiscard]] std::array<std::int8_t, 2> octahedral(const Vec3& normal) noexcept;

/// One part of a frame message.
struct EncodedPart {
    Bytes bytes;                // with its header; empty: there is no such part
    std::uint64_t version = 0;  // 0: not encoded yet
};

/// One encoded snapshot.
struct EncodedSnapshot {
    double time = 0.0;  // s
    std::uint64_t step = 0;
    std::uint32_t flags = 0;
    std::vector<EncodedPart> surfaces;   // one per body, then the tool's
    std::vector<EncodedPart> particles;  // one per body; from the last snapshot encoded while a viewer subscribed
    Bytes planes;                        // one part
    Bytes remaining;                     // kRemainingParts parts: proxies, hand, parameters, contact forces
};
inline constexpr std::uint32_t kRemainingParts = 4;

/// Appends the header of a frame message with this many parts; the number of parts comes last.
void append_frame_header(Bytes& message, const EncodedSnapshot& snapshot, std::uint32_t scene, std::uint32_t parts);

/// Encodes the snapshots of one scene.
class SnapshotEncoder {
  public:
    explicit SnapshotEncoder(const SceneDescription& description);

    /// Unchanged parts keep their version. Particles are encoded only if a viewer subscribed to them
    /// (`particles_watched`).
    void encode(const SceneSnapshot& snapshot, bool particles_watched, std::size_t viewers);
    [[nodiscard]] const EncodedSnapshot& encoded() const noexcept { return encoded_; }

  private:
    struct Surface {
        std::size_t first = 0;  // index of its first vertex
        std::size_t count = 0;
        std::vector<Triangle> faces;
        std::vector<Vec3> encoded_vertices;  // when last encoded
    };
    struct Particles {
        std::size_t first = 0;
        std::size_t count = 0;
        std::vector<Vec3> encoded_positions;
        std::vector<Quat> encoded_orientations;
    };

    void encode_surface(std::size_t k, PartKind kind, std::span<const Vec3> vertices);
    void encode_particles(std::size_t k, std::span<const Vec3> positions, std::span<const Quat> orientations);
    void encode_remaining(const SceneSnapshot& snapshot, std::size_t viewers);

    std::vector<Surface> surfaces_;
    std::vector<Particles> particles_;
    std::size_t parameters_ = 0;
    std::vector<Vec3> normals_;  // scratch
    EncodedSnapshot encoded_;
};

}  // namespace haptic::sim::view
