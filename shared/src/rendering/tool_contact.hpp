// Tool contact: force and torque of a contact frame on the grip, at an instant.
//
// Proxy i of N has the free position x_i = p + R (o_i + v_i a), where the grip (p, R) puts it if nothing is in the way:
// o_i its rest offset, v_i its rest velocity, a the age of the frame. Planes are extrapolated to the same time. Each
// plane is a row of the contact problem (contact_problem.hpp), with depth b = offset - n . x_i; each proxy with
// friction has two tangential rows, with b = t . (anchor - x_i), where the anchor is the point at which it sticks. With
// the relative compliance k W of the frame, k its stiffness, and the forces per stiffness l (m) that solve the problem:
//
//     F = k sum l d      T = k sum (x_i - p) x l d      V = k (l^T b - 1/2 l^T (k W) l), stored in tool and coupling
//
// d is the direction of a row. k W is constant within a frame, so without friction (F, T) is the negative gradient of V
// with respect to the pose. A frame without compliance is a limp tool: k C_ij = (N k / k_t) delta_ij + 1 - k / k_t
// between proxies i and j, which for k_t = k gives each proxy a spring k / N of its own. In free motion F and T are
// exactly zero. The coupling may be rendered softer than the frame asks for: k is then the smaller stiffness, l stays.
//
// Friction acts where a sphere touches, at -r n_i from its centre, with n_i the normal of its first plane, so that it
// adds
//
//     T = -k sum r n_i x l t
//
// and spheres turn with the grip: while R turns by dR, a sphere that sticks rolls on its surface, and its anchor moves
// by (dR - 1) r n_i, so that the hand's work against this torque is stored. By how much forces turn the tool in the
// grip is part of W. A proxy without a radius, or of a limp tool, has friction at its centre.
//
// A proxy that begins to touch sticks where that tick has left it. Its anchor moves with the surface, and while the
// frame reports it as sticking too, to the frame's position with a time constant of 0.1 s. It slides when static
// friction cannot hold it; the dynamic coefficient applies until it has come to rest, and the anchor follows at the
// distance at which the tangential force is at its limit.
// @source thesis, section 5.2.2 (limp tool), 5.4.1 (HAPTIC_FRAME_HOLD_POSITIONS); friction: Harwin, Melder 2002 (cone),
// Ruspini, Kolarov, Khatib 1997, section 5
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "haptic/contact_problem.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"
#include "rendering/prepared_frame.hpp"
#include "rendering/proxy_arrays.hpp"

namespace haptic {

/// Pose of the grip at an instant and at the tick before.
struct GripMotion {
    Pose pose;
    Pose previous;           // elapsed_s ago
    double elapsed_s = 0.0;  // s; 0: the previous pose is unknown, and displacements are zero
};

/// Friction of one proxy, kept from tick to tick.
struct FrictionState {
    Vec3 anchor{0.0, 0.0, 0.0};  // m, device frame, on the surface; valid in contact only
    bool in_contact = false;     // sticking or sliding
    bool sliding = false;
};

/// Effect of the contact frame on the grip at an instant.
struct Contact {
    Wrench wrench;
    Vec3 proxy{0.0, 0.0, 0.0};             // m, local proxy of the first particle; the grip if there is no particle
    std::uint32_t in_contact = 0;          // proxies that are pushed
    double stored = 0.0;                   // J, V
    double surface_power = 0.0;            // W, put into the springs by moving rest offsets, and by moving surfaces
                                           // unless the frame reports their work
    Vec3 surface_velocity{0.0, 0.0, 0.0};  // m/s, mean of these along the normals that push, weighted with the forces
    double share = 1.0;                    // 0..1, of the rendered stiffness: that of the present contacts; 1 without
    double displacement = 0.0;  // m, since the last tick, mean over the proxies in contact relative to their surfaces;
                                // over all proxies, relative to their planes, if none is
    double tool_displacement = 0.0;  // m, root mean square over all proxies, each relative to its surfaces
    double max_moment_arm = 0.0;     // m, largest |o_i|, and the largest arm of friction
};

/// Renders contact frames. All memory is allocated by the constructor.
class ToolContact {
  public:
    ToolContact();

    /// Takes a frame without a defect, which must stay as it is until another one is loaded. Friction states are kept.
    void load(PreparedFrame& frame) HAPTIC_RT;
    /// Evaluates the equations above for the loaded frame, with planes extrapolated to time_ns, but at most 1.5 steps
    /// beyond their own time, and with `stiffness` (N/m) in place of the frame's. Without a frame or stiffness, or
    /// clutched, there is no force; one that overflows is infinite. Bounded: two solutions of the contact problem.
    [[nodiscard]] Contact render(double stiffness, const GripMotion& grip, std::int64_t time_ns) HAPTIC_RT;
    /// The same at a pose at rest. Keeps the states of friction; the next solution starts from this one.
    [[nodiscard]] Contact preview(double stiffness, const Pose& grip, std::int64_t time_ns) HAPTIC_RT;
    /// The wrench per stiffness of preview(), from the loaded frame's preview if it has one from here.
    [[nodiscard]] Wrench springs_at(const Pose& grip, std::int64_t time_ns) HAPTIC_RT;
    /// Where the next frame starts, after a render() at this pose.
    [[nodiscard]] FrameStart next_start(const Pose& grip, std::int64_t time_ns) const HAPTIC_RT;
    /// Ahead of the tick, in another instance than the tick's: gives the frame the preview from there, unless it
    /// depends on states of friction. Loads the frame.
    void preview_ahead(PreparedFrame& frame, const FrameStart& start) HAPTIC_RT;
    /// The next contacts begin without friction.
    void forget_friction() HAPTIC_RT;

    [[nodiscard]] const FrictionState& friction(std::size_t proxy) const HAPTIC_RT { return friction_[proxy]; }

  private:
    /// One instant of a frame; tool_contact.cpp.
    class Instant;

    /// Per proxy, of the latest evaluation.
    struct Proxies {
        ProxyVectors arm;            // m, R (o_i + v_i a): from the grip's origin
        ProxyVectors position;       // m, free
        ProxyVectors displacement;   // m, of the free position since the last tick, if the previous pose is known
        ProxyVectors rest_velocity;  // m/s, R v_i while it is extrapolated
        std::array<ProxyValues, kMaxPlanes> depth{};  // m, b of the normal rows
        std::array<ProxyValues, kMaxPlanes> force{};  // m, l of the normal rows: forces per stiffness
        ProxyVectors pull;                            // m, sum of l d over the rows
        ProxyValues energy{};                         // m^2, of the springs of an independent proxy
        ProxyValues touches{};                        // 1: it is pushed, 0: it is not
        ProxyVectors torque;                          // m^2, arm x pull
        ProxyVectors surface_velocity;                // m^2/s, its surfaces' along their normals, times the forces
        ProxyValues power{};                          // m^2/s, put into the springs by them
        ProxyValues displaced{};                      // m, relative to its surfaces
    };

    void start_frame() HAPTIC_RT;

    const ContactKernels* kernels_;
    PreparedFrame* prepared_ = nullptr;
    bool is_new_ = false;              // no solution of the frame has started
    RowSet start_;                     // normal rows from which its first solution starts
    ComplianceMatrix own_compliance_;  // k W of the rows of one proxy, if the proxies are independent
    ContactSolver solver_;
    std::array<FrictionState, kMaxProxies> friction_{};
    bool has_friction_state_ = false;  // one of them is not the initial one
    Proxies proxies_;
    // Per row, of the latest evaluation: of a tool with a compliance, and of independent proxies with friction.
    std::vector<double> depth_;      // m, b
    std::vector<double> force_;      // m, l
    std::vector<double> displaced_;  // m, k W l
    std::vector<FrictionRows> pairs_;
};

}  // namespace haptic
