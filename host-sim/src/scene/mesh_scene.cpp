#include "scene/mesh_scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "dynamics/rotation.hpp"
#include "haptic/setting.hpp"
#include "haptic/sim/material.hpp"
#include "scene/relief.hpp"

namespace haptic::sim {
namespace {

// The body.
constexpr double kLength = 0.2;                 // m, its longest side
constexpr const char* kSolid = "gelatin 10 %";  // of a closed mesh
constexpr const char* kSheet = "latex";         // of an open one
// Of an open mesh beyond which it is no sheet, which has a particle at each vertex: a step would take longer than
// kStep.
constexpr std::size_t kMaxSheetVertices = 4000;
constexpr double kShellDensity = 0.4;  // kg/m^2, of such a mesh: 4 mm of foam
constexpr double kShellStiffness = 0.6;
constexpr int kShellIterations = 5;
constexpr double kShellDamping = 5.0;  // 1/s
constexpr double kMinMass = 0.001;     // kg
constexpr double kMaxDensity = 1e5;    // kg/m^3, kg/m^2: the most that a scene may give
constexpr double kMaxSlimness = 1.5;   // height over the narrower side of what stands; more would topple
constexpr int kParticles = 100;
constexpr double kMaxEdge = 0.02;   // m
constexpr double kBridge = 1.0;     // m, more than its diagonal
constexpr double kMaxOffset = 1e4;  // m, of a body's position

constexpr double kStep = 0.005;  // s
constexpr double kDrag = 2.0;    // 1/s
constexpr double kStaticFriction = 0.5;
constexpr double kDynamicFriction = 0.4;

// The sphere that touches it, and its coupling to the hand.
constexpr double kRadius = 0.012;  // m
constexpr double kReach = 0.01;    // m
// N/m per kg of the body: a light body feels like a heavy one, the force scale makes up for its mass. Pressed by kDepth
// it takes 1.4 times its weight, and hardly moves.
constexpr double kStiffnessPerMass = 700.0;
constexpr double kDampingTime = 0.004;  // s
constexpr double kMaskRadius = 0.02;    // m

// The hand's way: high above the body until it is at rest, down to it, into it, up.
constexpr double kClearance = 0.04;     // m, above the body, and above where it is touched
constexpr double kDepth = 0.02;         // m, beyond that: a tenth of the body's length
constexpr double kMinDepth = 0.01;      // m, into a thin one
constexpr double kDepthOfHeight = 0.6;  // of where it is touched: the ground behind it does not yield
constexpr double kMaxRest = 3.0;        // s, after which the body is touched even if it still moves
constexpr double kBuilt = 0.5;          // share of the time after which the body is built
constexpr double kRestPart = 0.5;       // s, after each of which its speed is looked at
constexpr double kRestSpeed = 0.02;     // m/s, of its fastest particle, below which it is at rest
constexpr std::array<double, 5> kTimesAfterRest{0.0, 0.5, 1.5, 2.5, 3.0};  // s

// At the device. An X3R makes every wrench within 20 mm of its centre.
constexpr double kScaleAtHand = 0.2;  // m per m of the scene
constexpr double kLengthAtHand = kScaleAtHand * kLength;
constexpr double kForceAtHand = 1.0;           // N, the peak that the force scale aims at
constexpr double kMaxStiffnessAtHand = 400.0;  // N/m
constexpr double kMaxForceScale = 100.0;       // the most that a scene may give

/// Everything in a scene that differs from one mesh to the next.
struct Choices {
    double scale = 1.0;  // m per unit of the mesh
    Quat orientation{1.0, 0.0, 0.0, 0.0};
    std::string stance;       // why this orientation
    Vec3 offset{0.0};         // m
    double density = 0.0;     // kg/m^3, of a sheet kg/m^2
    double mass = 0.0;        // kg
    double stiffness = 0.0;   // N/m, of the coupling
    double depth = kDepth;    // m, that the hand presses
    double high = 0.0;        // m, height at which the hand waits
    double rest = kRestPart;  // s, when the body is at rest
    Vec3 touch{0.0};          // m, of the sphere's centre where it first touches the body
    double force_scale = 1.0;
    double peak_force = 0.0;  // N, in the scene
};

std::string shown(double value, int digits = 3) {
    std::array<char, 40> text{};
    (void)std::snprintf(text.data(), text.size(), "%.*g", digits, value);
    return text.data();
}

/// Rounded to so many significant digits, so that the numbers of the file are short.
double rounded(double value, int digits = 3) {
    return std::strtod(shown(value, digits).c_str(), nullptr);
}

/// Rounded to a hundredth of a millimetre.
Vec3 rounded(const Vec3& p) {
    constexpr double per_m = 1e5;
    return glm::round(p * per_m) / per_m;
}

/// Stands the body on the ground, as it is in its file unless it would topple.
void place(const MeshReport& report, const std::string& file, Choices& c) {
    struct Stance {
        Quat orientation;
        const char* why;
    };
    constexpr double half = 0.7071067811865476;
    const std::array<Stance, 3> stances{{{{1.0, 0.0, 0.0, 0.0}, "as in the file, y up"},
                                         {{half, -half, 0.0, 0.0}, "the file's z up; with y up it would topple"},
                                         {{half, 0.0, 0.0, half}, "the file's x up; else it would topple"}}};
    const Vec3 size = report.high - report.low;
    c.scale = rounded(kLength / std::max({size.x, size.y, size.z}), 4);
    // The first axis about which it is broad enough. With its shortest side upright it always is.
    Vec3 stood(0.0);
    for (const Stance& stance : stances) {
        c.orientation = stance.orientation;
        c.stance = stance.why;
        stood = glm::abs(c.scale * (to_matrix(stance.orientation) * size));
        if (stood.y <= kMaxSlimness * std::min(stood.x, stood.z)) {
            break;
        }
    }
    // Its middle above the origin, its lowest point on the ground.
    const Vec3 middle = c.scale * (to_matrix(c.orientation) * (0.5 * (report.low + report.high)));
    c.offset = rounded(Vec3(0.0, 0.5 * stood.y, 0.0) - middle);
    c.high = stood.y + kRadius + kClearance;
    if (std::max({std::abs(c.offset.x), std::abs(c.offset.y), std::abs(c.offset.z)}) > kMaxOffset) {
        throw MeshError(file + ": lies " + shown(glm::length(middle) / kLength) +
                        " times its length from its origin, where the coordinates of files are coarse; move it to the "
                        "origin");
    }
}

/// What is made of the mesh.
enum class BodyKind : std::uint8_t {
    Solid,
    Sheet,
    Shell  // open, with too many vertices for a sheet: keeps its shape by shape matching, without a material
};

BodyKind kind_of(const MeshReport& report) {
    return report.closed ? BodyKind::Solid : report.vertices > kMaxSheetVertices ? BodyKind::Shell : BodyKind::Sheet;
}

/// kg/m^3 of a solid's material, else kg/m^2.
double usual_density(BodyKind kind) {
    switch (kind) {
        case BodyKind::Solid:
            return find_material(kSolid).solid.density;
        case BodyKind::Sheet:
            return find_material(kSheet).sheet.areal_density;
        case BodyKind::Shell:
            break;
    }
    return kShellDensity;
}

/// Density and mass of the body in the scene. Small and thin bodies are denser than their material, so that the hand
/// feels them.
void weigh(const MeshReport& report, Choices& c) {
    // Both faces of a double-faced sheet are one.
    const double single = 1.0 - static_cast<double>(report.double_faced) / static_cast<double>(report.triangles);
    const double size =
        report.closed ? report.volume * c.scale * c.scale * c.scale : single * report.area * c.scale * c.scale;
    c.density = std::min(rounded(std::max(usual_density(kind_of(report)), kMinMass / size)), kMaxDensity);
    c.mass = rounded(c.density * size);
}

/// One for each of times_of().
std::vector<Vec3> way_of_hand(const Choices& c) {
    const Vec3 high(c.touch.x, c.high, c.touch.z);
    const Vec3 above = c.touch + Vec3(0.0, kClearance, 0.0);
    const Vec3 pressed = c.touch - Vec3(0.0, c.depth, 0.0);
    std::vector<Vec3> way{high, high, above, pressed, pressed, high};
    for (Vec3& p : way) {
        p = rounded(p);
    }
    return way;
}

std::vector<double> times_of(const Choices& c) {
    std::vector<double> times{0.0};
    for (const double after : kTimesAfterRest) {
        times.push_back(c.rest + after);
    }
    return times;
}

/// Position of the scene's origin in the device, m. The middle of the device is half way between the ground and the
/// upper end of the hand's way, so that all of the body is within reach.
Vec3 workspace_offset(const Choices& c) {
    return rounded(-kScaleAtHand * Vec3(c.touch.x, 0.5 * c.high, c.touch.z));
}

/// N/m at the hand.
double stiffness_at_hand(const Choices& c) {
    return c.force_scale * c.stiffness / kScaleAtHand;
}

/// Of the material of a solid or a sheet.
std::string described_stiffness(BodyKind kind) {
    return kind == BodyKind::Solid ? shown(1e-3 * find_material(kSolid).solid.young_modulus) + " kPa"
                                   : shown(find_material(kSheet).sheet.membrane_stiffness) + " N/m";
}

/// The material and its stiffness, for people.
std::string described_material(BodyKind kind) {
    switch (kind) {
        case BodyKind::Solid:
            return std::string(kSolid) + ", a solid of " + described_stiffness(kind);
        case BodyKind::Sheet:
            return std::string(kSheet) + ", a sheet of " + described_stiffness(kind);
        case BodyKind::Shell:
            break;
    }
    return "none: a sheet in real time has at most " + std::to_string(kMaxSheetVertices) + " vertices";
}

/// A line with what it means in a second column.
std::string line(const std::string& text, const std::string& meaning) {
    constexpr std::size_t column = 34;
    const std::size_t room = text.size() < column ? column - text.size() : 1;
    return text + (meaning.empty() ? "" : std::string(room, ' ') + "# " + meaning) + '\n';
}

template <typename T>
std::string setting(const char* key, const T& value, const std::string& meaning = {}) {
    return line(std::string(key) + " = " + toml_value(value), meaning);
}

std::string particles_text(BodyKind kind) {
    return kind == BodyKind::Sheet ? setting("particles_count", std::int64_t{0}, "one at each vertex, as a sheet needs")
                                   : setting("particles_count", std::int64_t{kParticles},
                                             "more follow the shape better and take more time");
}

/// What the body is of. A density is given only if it is not that of the material.
std::string material_text(const Choices& c, BodyKind kind) {
    if (kind == BodyKind::Shell) {
        return setting("material", std::string("none"), "a mesh that is open and so fine makes no sheet in real time") +
               setting("mass", c.mass, "kg: a sheet of foam of 4 mm; at least 1 g") +
               setting("group_stiffness", kShellStiffness, "from 0, limp, to 1, rigid; depends on the steps");
    }
    const bool solid = kind == BodyKind::Solid;
    std::string text =
        "\n" + line("[model.material]", "`host-sim materials` lists the names") +
        setting("name", std::string(solid ? kSolid : kSheet),
                described_stiffness(kind) + (solid ? ", a solid: the mesh is closed" : ", a sheet: the mesh is open"));
    if (c.density != usual_density(kind)) {
        text += solid ? setting("density", c.density, "kg/m^3: 1 g in all, so that it is felt")
                      : setting("areal_density", c.density, "kg/m^2: 1 g in all, so that it is felt");
    }
    return text;
}

/// Shape matching needs iterations and damping; a material has its own.
std::string solver_text(BodyKind kind) {
    std::string text = "\n[solver]\n" + setting("step", kStep, "s");
    if (kind == BodyKind::Shell) {
        text += setting("iterations", std::int64_t{kShellIterations}, "more are stiffer and take more time") +
                setting("shape_damping", kShellDamping, "1/s, of motion within the body");
    }
    return text + setting("drag", kDrag, "1/s, of all motion: what was pushed comes to rest");
}

/// The scene file.
std::string text_of(const Choices& c, const std::string& file, const MeshReport& report) {
    const BodyKind kind = kind_of(report);
    std::string way;
    for (const Vec3& p : way_of_hand(c)) {
        way += (way.empty() ? "" : ",  ") + toml_value(p.x) + ", " + toml_value(p.y) + ", " + toml_value(p.z);
    }
    return "# A hand presses a mesh; written by host-sim new-scene. Change what you like: `host-sim scenes "
           "--reference`\n"
           "# lists every key. Units: m, kg, s, N; y points up.\n" +
           setting("description", "A hand presses " + file.substr(file.rfind('/') + 1)) +  //
           setting("duration", times_of(c).back(), "s") + "\n[model]\n" +                  //
           setting("file", file, "found from the folder of this file") +
           setting("scale", c.scale, "m per unit of the mesh: its longest side is " + shown(kLength) + " m") +
           setting("orientation", c.orientation, c.stance) +
           setting("height", c.offset.y, "m: its lowest point is on the ground") +
           setting("offset", Vec3(c.offset.x, 0.0, c.offset.z), "m: its middle is above the origin") +
           setting("max_edge", kMaxEdge, "m: longer edges are divided, so that a coarse mesh bends") +
           particles_text(kind) +
           setting("bridge", kBridge, "m: parts that share no vertex are one body, over any gap") +  //
           material_text(c, kind) + solver_text(kind) + "\n[collisions]\n" +                         //
           setting("ground", true, "at height 0") +
           setting("static_friction", kStaticFriction, "of the body on the ground") +
           setting("dynamic_friction", kDynamicFriction) + "\n[proxy]\n" +                               //
           setting("radius", kRadius, "m, of the sphere in the hand") + setting("reach", kReach, "m") +  //
           setting("static_friction", kStaticFriction, "of the sphere on the body") +
           setting("dynamic_friction", kDynamicFriction) + "\n[coupling]\n" +  //
           setting("stiffness", c.stiffness,
                   "N/m, between hand and sphere: " + shown(kStiffnessPerMass, 4) + " per kg of the body") +
           setting("damping_time", kDampingTime, "s") +
           setting("mask_radius", kMaskRadius, "m, of the patch of the body that takes the force") + "\n" +
           line("[hand]", "waits until the body is at rest, comes down on it, presses and holds it, leaves") +
           setting("times", times_of(c), "s") +  //
           "positions = [\n    " + way + "\n]\n" + setting("repeat", true) + "\n[workspace]\n" +
           setting("scale", kScaleAtHand,
                   "the longest side is " + shown(1e3 * kLengthAtHand) +
                       " mm at the device, which reaches 20 mm each way") +
           setting("offset", workspace_offset(c), "m: the middle of body and way is that of the device") +
           setting("force_scale", c.force_scale,
                   "at most " + shown(c.force_scale * c.peak_force, 2) + " N at the hand, a spring of " +
                       shown(stiffness_at_hand(c)) + " N/m");
}

/// The scene that the text describes, with its mesh in memory.
Scene scene_of(const std::string& text, const std::string& file, const std::shared_ptr<const TriangleMesh>& mesh) {
    Config config = Config::parse(text, file);
    config.set("model.file=\"\"");  // is not read
    Scene scene = read_scene(config, std::filesystem::path(file).stem().string());
    scene.model.file = file;
    scene.model.mesh = mesh;
    scene.model.place = {};  // the user has not seen the text
    return scene;
}

/// Runs a scene whose hand waits above the body.
class Trial {
  public:
    /// `progress`: of building and, from then on, of `expected_s` that are simulated at most.
    Trial(const Scene& scene, Simulation::ClockFunction clock, const Progress& progress, double expected_s)
        : simulation_(scene, clock, part_of(progress, 0.0, kBuilt)), progress_(progress), expected_s_(expected_s) {}

    [[nodiscard]] const Simulation& simulation() const noexcept { return simulation_; }
    [[nodiscard]] double peak_force() const noexcept { return peak_force_; }
    /// m/s, of the fastest particle.
    [[nodiscard]] double speed() const {
        double fastest = 0.0;
        for (const Vec3& velocity : simulation_.model().velocity) {
            fastest = std::max(fastest, glm::length(velocity));
        }
        return fastest;
    }
    /// Median of all steps, us; 0 without a clock.
    [[nodiscard]] double step_us() const {
        std::vector<std::int64_t> times = times_ns_;
        const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
        std::nth_element(times.begin(), middle, times.end());
        return 1e-3 * static_cast<double>(*middle);
    }

    void run_until(double time_s, const PoseTrack& hand) {
        while (simulation_.time() < time_s - 0.5 * kStep) {
            StepInput input;
            input.time_ns = nanoseconds(simulation_.time());
            report(progress_, kBuilt + (1.0 - kBuilt) * simulation_.time() / expected_s_);
            input.device = simulation_.workspace().to_device(hand.at(input.time_ns));
            const StepResult result = simulation_.step(input);
            peak_force_ = std::max(peak_force_, glm::length(result.force));
            times_ns_.push_back(result.times.total_ns);
        }
    }

  private:
    Simulation simulation_;
    const Progress& progress_;
    double expected_s_;
    double peak_force_ = 0.0;  // N, in the scene
    std::vector<std::int64_t> times_ns_;
};

PoseTrack track_of(const Choices& c) {
    std::vector<Pose> poses;
    for (const Vec3& p : way_of_hand(c)) {
        poses.emplace_back().position = p;
    }
    return {times_of(c), std::move(poses)};
}

std::string explain(const Choices& c, const MeshReport& report, const Trial& trial) {
    const Vec3 size = report.high - report.low;
    const auto mm = [](double m) { return shown(1e3 * m) + " mm"; };
    std::string text = "  mesh          " + std::to_string(report.triangles) + " triangles, " +
                       (report.closed ? "watertight" : "not watertight: taken for a surface without inside") +
                       "; parts: " + std::to_string(report.components) + "; " + shown(size.x) + " x " + shown(size.y) +
                       " x " + shown(size.z) + " units\n" + "  scale         1 unit is " + shown(c.scale, 4) +
                       " m: its longest side is " + shown(kLength) + " m in the scene and " + mm(kLengthAtHand) +
                       " at the\n                hand, which reaches 20 mm each way\n" + "  stands        " + c.stance +
                       "\n" + "  material      " + described_material(kind_of(report)) + "; " + shown(c.mass) +
                       " kg\n" + "  particles     " + std::to_string(trial.simulation().model().size()) +
                       "; a step of " + shown(1e3 * kStep) + " ms takes " + shown(1e-3 * trial.step_us(), 2) +
                       " ms here\n" + "  touch         from above at x " + mm(c.touch.x) + ", z " + mm(c.touch.z) +
                       ", " + mm(c.depth) + " deep; at most " + shown(c.force_scale * c.peak_force, 2) +
                       " N at the hand\n";
    for (const std::string& warning : report.warnings) {
        text += "  warning: " + warning + '\n';
    }
    return text;
}

}  // namespace

MeshScene make_mesh_scene(const CheckedMesh& mesh, const std::string& file, Simulation::ClockFunction clock,
                          const Progress& progress) {
    const auto shared = std::make_shared<const TriangleMesh>(mesh.mesh);
    const MeshReport& report = mesh.report;
    Choices c;
    place(report, file, c);
    weigh(report, c);
    c.stiffness = rounded(kStiffnessPerMass * c.mass, 2);
    // The body comes to rest under a hand that waits.
    Trial trial(scene_of(text_of(c, file, report), file, shared), clock, progress,
                times_of(c).back() + kMaxRest - c.rest);
    trial.run_until(c.rest, track_of(c));
    while (c.rest < kMaxRest && trial.speed() > kRestSpeed) {
        c.rest += kRestPart;
        trial.run_until(c.rest, track_of(c));
    }
    // It is touched from above, where a sphere stays.
    const Simulation& rested = trial.simulation();
    c.touch = rounded(Relief(rested.vertices(), rested.mesh().triangles, kRadius).best_spot());
    c.high = std::max(c.high, c.touch.y + kClearance);
    // A sheet folds away, and the ground behind a thin body does not yield.
    const double height = c.touch.y - kRadius;
    c.depth = kind_of(report) == BodyKind::Sheet ? kMinDepth
                                                 : rounded(std::clamp(kDepthOfHeight * height, kMinDepth, kDepth));
    trial.run_until(times_of(c).back(), track_of(c));
    // The peak of the force becomes that for the hand, as far as the device is as stiff.
    c.peak_force = trial.peak_force();
    if (!(c.peak_force > 0.0)) {
        throw std::runtime_error(file + ": the hand that came down on it did not touch it");
    }
    const double max_scale = std::min(kMaxStiffnessAtHand * kScaleAtHand / c.stiffness, kMaxForceScale);
    c.force_scale = rounded(std::min(kForceAtHand / c.peak_force, max_scale), 2);
    MeshScene made;
    made.text = text_of(c, file, report);
    made.scene = scene_of(made.text, file, shared);
    made.explanation = explain(c, report, trial);
    return made;
}

}  // namespace haptic::sim
