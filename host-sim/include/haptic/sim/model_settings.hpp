// The [model] table of a scene: which body is made, from a generator or a mesh file, and where its copies stand.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/block.hpp"
#include "haptic/sim/cloth.hpp"
#include "haptic/sim/curtain.hpp"
#include "haptic/sim/deformable.hpp"
#include "haptic/sim/fan.hpp"
#include "haptic/sim/fish.hpp"
#include "haptic/sim/model_builder.hpp"
#include "haptic/sim/organ.hpp"
#include "haptic/sim/progress.hpp"
#include "haptic/sim/rigid_shapes.hpp"

namespace haptic::sim {

enum class Generator : std::uint8_t { Cloth, Curtain, Fan, Fish, Plate, Rod, Block, Organ };

/// Material by name or by values; those given replace those of the name.
struct MaterialSettings {
    Config::Place place = {};  // for errors that are found while the body is made
    std::string name;
    std::optional<double> young_modulus;       // Pa
    std::optional<double> poisson_ratio;       // 0..kMaxPoissonRatio
    std::optional<double> density;             // kg/m^3
    std::optional<double> membrane_stiffness;  // N/m
    std::optional<double> bending_stiffness;   // N m
    std::optional<double> areal_density;       // kg/m^2
    std::optional<double> damping;             // s
};

/// Properties of the particles whose rest position is in a box: table [[model.regions]].
struct Region {
    Config::Place place = {};
    Vec3 low{0.0};  // m, in the body's frame, the border included
    Vec3 high{0.0};
    std::optional<double> stiffness;           // 0..1, of the groups about these particles
    std::optional<MaterialSettings> material;  // of the body about these particles
    bool fixed = false;                        // they stay where they are
    // If there are times, they are led: see Motion.
    std::vector<double> motion_times;  // s
    std::vector<Vec3> motion_offsets;  // m, in the body's frame
    bool motion_repeat = false;
    // Loads: see Load. Both may be given, and have the same course.
    Vec3 force{0.0};                   // N, in the scene, of all free particles together
    double pressure = 0.0;             // Pa, on the triangles with all corners in the box
    std::vector<double> load_times{};  // s; empty: constant loads
    std::vector<double> load_factors{};
    bool load_repeat = false;
};

struct ModelSettings {
    Config::Place place = {};
    Generator generator = Generator::Cloth;
    ClothShape cloth;  // its centre at (0, height + shift, 0)
    CurtainShape curtain;
    FanShape fan;
    FishShape fish;
    PlateShape plate;
    RodShape rod;
    BlockShape block;
    OrganShape organ;
    double mass = 0.1;  // kg, of the whole body
    std::string file;   // of a mesh that takes the place of what is generated; empty: none
    /// What `file` holds, in its unit; null: the file is read.
    std::shared_ptr<const TriangleMesh> mesh;
    double file_scale = 0.0;  // m per unit of the file; 0: centred, and as long as what would be generated
    double max_edge = 0.0;    // m, longer edges of the mesh are divided; 0: none are
    std::string particles;    // a model file, whose particles take the place of those made; empty: none
    BuilderSettings builder;  // of block, fish, organ and meshes from files
    Vec3 velocity{0.0};       // m/s, at the start
    /// With a material neither mass nor the stiffnesses and compliances below count.
    std::optional<MaterialSettings> material;
    double group_stiffness = 0.3;   // 0..1, alpha of the shape-matching groups
    double link_stiffness = 1.0;    // 0..1, of the distance constraints
    double group_compliance = 0.0;  // s^2, see Group
    double link_compliance = 0.0;   // m/N
    Placement placement;            // of all but the generated cloth, which is made in its place; without velocity
    std::vector<Region> regions;    // of two with a particle in common, the later one counts
    std::vector<Placement> copies{Placement{}};
};

/// Reads a table of the configuration, "model" or "objects.0", with all that is in it. Throws ConfigError.
[[nodiscard]] ModelSettings read_model(const Config& config, const std::string& table);

/// Triangles of the meshes that make_bodies generates, all copies together, before anything is made; 0 for a mesh from
/// a file: unknown until it is read.
[[nodiscard]] std::size_t expected_triangles(const ModelSettings& settings);
/// Whether the generator makes rigid bodies.
[[nodiscard]] bool is_rigid(const ModelSettings& settings) noexcept;

/// Makes one body about the origin, not turned, with what the regions say of it. A region without a particle is refused
/// unless the mesh is from a file: built-in scenes then run with any mesh. Throws ConfigError with the place that the
/// settings have.
[[nodiscard]] DeformableBody make_body(const ModelSettings& settings, const Progress& progress = {});

/// Makes the bodies in their places, one for each copy. Throws as make_body does.
[[nodiscard]] std::vector<DeformableBody> make_bodies(const ModelSettings& settings, const Progress& progress = {});

}  // namespace haptic::sim
