// What goes to viewers, as bytes (host-sim/page/PROTOCOL.md). Pure: descriptions and moments in, messages out.
//
// A moment is encoded once for all viewers, in parts that begin with their own header; what a viewer gets is a header
// and those parts whose version it does not have. A part gets another version when what it shows has changed since it
// was encoded last.
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

/// What the kinds of binary messages, and of the parts of a frame, are called.
enum class MessageKind : std::uint32_t { Geometry = 1, Frame = 2, Samples = 3 };
enum class PartKind : std::uint32_t {
    BodySurface = 1,
    ToolSurface = 2,
    Particles = 3,
    Proxies = 4,
    Planes = 5,
    Hand = 6,
    Parameters = 7
};

/// The message "scene". `scene` is the number of the description among those of this view.
[[nodiscard]] std::string scene_message(const SceneDescription& description, std::uint32_t scene, bool control);

/// The message "geometry": what goes with it.
[[nodiscard]] Bytes geometry_message(const SceneDescription& description, std::uint32_t scene);

/// The message "samples". None of them is missing in between; `dropped` are missing before the first.
[[nodiscard]] Bytes samples_message(std::span<const StepSample> samples, std::uint32_t scene, std::uint32_t dropped);

/// The triangles without those whose three vertices another one before them has: a surface with two faces is drawn
/// once, and the normals of its faces do not cancel.
[[nodiscard]] std::vector<Triangle> single_faces(std::span<const Triangle> triangles);

/// A unit vector as two numbers, v / 127. Anything that has no direction becomes (0, 0, 1).
/// @source Z. Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", 2014
[[nodiscard]] std::array<std::int8_t, 2> octahedral(const Vec3& normal) noexcept;

/// A part of a frame.
struct EncodedPart {
    Bytes bytes;                // with its header; empty: there is none
    std::uint64_t version = 0;  // 0: not encoded yet
};

/// One moment.
struct EncodedMoment {
    double time = 0.0;  // s
    std::uint64_t step = 0;
    std::uint32_t flags = 0;
    std::vector<EncodedPart> surfaces;   // per body, and the tool's last
    std::vector<EncodedPart> particles;  // per body; as old as the last moment in which somebody watched them
    Bytes planes;                        // one part
    Bytes rest;                          // kRestParts parts: proxies, hand, parameters
};
inline constexpr std::uint32_t kRestParts = 3;

/// The header of a frame with that many parts; the number of parts comes last.
void append_frame_header(Bytes& message, const EncodedMoment& moment, std::uint32_t scene, std::uint32_t parts);

/// Encodes the moments of one scene.
class MomentEncoder {
  public:
    explicit MomentEncoder(const SceneDescription& description);

    /// Parts that are as they were keep their version. Particles are encoded only if they are `watched`.
    void encode(const SceneSnapshot& snapshot, bool particles_watched, std::size_t viewers);
    [[nodiscard]] const EncodedMoment& moment() const noexcept { return moment_; }

  private:
    struct Surface {
        std::size_t first = 0;  // of the vertices it is made of
        std::size_t count = 0;
        std::vector<Triangle> faces;
        std::vector<Vec3> shown;  // as encoded last
    };
    struct Particles {
        std::size_t first = 0;
        std::size_t count = 0;
        std::vector<Vec3> shown;
        std::vector<Quat> shown_orientations;
    };

    void encode_surface(std::size_t k, PartKind kind, std::span<const Vec3> vertices);
    void encode_particles(std::size_t k, std::span<const Vec3> places, std::span<const Quat> orientations);
    void encode_rest(const SceneSnapshot& snapshot, std::size_t viewers);

    std::vector<Surface> surfaces_;
    std::vector<Particles> particles_;
    std::size_t parameters_ = 0;
    std::vector<Vec3> normals_;  // scratch
    EncodedMoment moment_;
};

}  // namespace haptic::sim::view
