// Passivity observer and controller at the grip: what is rendered may not give the hand more energy than it took in.
//
// Observer. The motors hold their tensions from one tick to the next, so the energy that the strings took from the grip
// in a tick is exactly the wrench that was held times the displacement, whatever the path between:
//     E += -(F . dx + T . dtheta)                                 taken from the hand
//        + b |dx|^2 / dt + b_r |dtheta|^2 / dt                    the device's own damping eats at least as much
//        + (P_s now + P_s before) / 2 dt,  P_s = sum f_i v_s,i / N   work of surfaces that the frame says to move;
//                                                                 of one that goes, E / (stored + store) of it
//     E  = min(E, stored + store)                                 spring energy of the coupling, and a little
// while a wrench is asked for. Without one nothing counts but that energy which is left over is lost (E = min(E, 0))
// and that debt is forgotten slowly: what was stored in one contact licenses nothing in the next. The third term is
// what a moving fish may do to a resting hand: the frame's planes announce it by their velocity; a surface that moves
// unannounced, as one does that answers an old pose, gets no credit. The fourth line bounds what lies can do.
// For a spring K held for a period T against a resting wall E >= 0 exactly as long as K <= 2 b / T, and this is so for
// every motion: E = K d^2 / 2 + (b / T - K / 2) sum |dx|^2.
//
// Controller. A wrench is only begun or kept up if it can be ended again. To go to zero at the limits of rate takes
// gamma tau, tau = max(|F| / force_rate, |T| / torque_rate), after a tick of holding; in this time a grip that is let
// go meanwhile moves by v h + a h^2 / 2 in the mean, h = gamma (T + gamma tau / 2), so that the wrench gamma w gives
//     P h + Q h^2 / 2 <= E + allowance,    P = max(0, w . v),    Q = |F|^2 / m + |T|^2 / I
// whose largest gamma <= 1 has a closed form. gamma falls at once, and comes back with a time constant while the wrench
// does no work. A brake of (1 - gamma) d acts beside it, and what it takes in is never given back, so that a vibration
// that was stopped from growing decays. gamma is 1 in an ideal contact (K < m / T^2, K v < force_rate): the wrench is
// then the wished one to the last bit. No wrench is made where none is asked for, whatever the debt: free motion stays
// exactly zero. What gamma is computed from counts only `damping_credit` of the device's damping.
//
// The other controller, `Damp`, is the original one: alpha v against the motion that pays a debt back, bounded by what
// is stable at the sample rate, for translation and rotation each with an observer of its own.
// @source Hannaford and Ryu 2002, Time-domain passivity control of haptic interfaces; Stramigioli, Secchi, van der
// Schaft and Fantuzzi 2005, Sampled data systems passivity and discrete port-Hamiltonian systems (energy over a tick is
// exact); Kim and Ryu 2010, energy bounding algorithm (credit for the device's damping); Franken, Stramigioli et al.
// 2011 (tank). The bound by what ending the wrench costs is ours.
#pragma once

#include <cstdint>

#include <haptic/realtime.hpp>
#include "rendering/limits.hpp"
#include <haptic/types.hpp>

namespace haptic::rt {

enum class PassivityControl : std::uint8_t {
    Observe,  // only logs
    Bound,    // gamma
    Damp      // alpha
};

struct PassivitySettings {
    PassivityControl control = PassivityControl::Bound;
    double allowance = 4e-5;           // J, that a contact may give beyond what it took; far below what is felt
    double store = 1e-3;               // J, that may be kept beyond what the coupling's springs hold
    double recovery_s = 0.05;          // s, time constant with which gamma comes back to 1
    double brake = 3.0;                // N s/m, against the grip's motion for gamma = 0; stable far below m / T = 100
    double rotational_brake = 6e-4;    // N m s/rad, likewise; I / T = 0.02
    double forget_s = 5.0;             // s, time constant with which debt is forgotten in free motion
    double surface_power = 10.0;       // W, that announced motion of surfaces may bring at most; 0: none is believed
    double damping = 0.3;              // N s/m, of the device, that it surely has
    double damping_credit = 0.5;       // 0..1, part of it that the contact may use up; the rest makes vibration decay
    double rotational_damping = 6e-5;  // N m s/rad
    double mass = 0.1;                 // kg, of the grip alone: the least that the wrench may have to move
    double inertia = 2e-5;             // kg m^2
    double largest_damping = 30.0;     // N s/m, alpha at most; m / T is 100, half of that oscillates
    double largest_rotational_damping = 6e-3;  // N m s/rad
};

/// What happened since the last tick.
struct PassivityMotion {
    Vec3 moved{0.0, 0.0, 0.0};   // m, displacement of the grip
    Vec3 turned{0.0, 0.0, 0.0};  // rad, rotation vector, device frame
    double elapsed_s = 0.0;      // s, that it took; 0 if the pose was not measured
    Wrench held;                 // that the strings made meanwhile, mean over the way
    bool asked = false;          // a wrench other than zero was asked of them
};

/// What is to be rendered now.
struct PassivityWish {
    Wrench wrench;
    double stored = 0.0;         // J, in the springs of the coupling
    double surface_power = 0.0;  // W, that moving surfaces put into it
    double elapsed_s = 0.001;    // s, since the last tick
    double period_s = 0.001;     // s, from now until another wrench can take its place
};

class Passivity {
  public:
    Passivity(const PassivitySettings& settings, const WrenchLimits& limits) : settings_(settings), limits_(limits) {}

    struct Result {
        Wrench wrench;
        double scale = 1.0;  // gamma
        bool acted = false;  // the wrench is not what was wished
    };
    /// Once a tick. A wish of exactly zero is granted as it is, and one that is not limited bit for bit. What is not
    /// finite counts as zero.
    Result apply(const PassivityMotion& motion, const PassivityWish& wish) HAPTIC_RT;
    void reset() HAPTIC_RT;

    /// J, taken in and not given back, of translation and rotation together, as defined above. Observed: negative is
    /// what went out without having come in.
    [[nodiscard]] double energy() const HAPTIC_RT { return energy_; }
    [[nodiscard]] double translation_energy() const HAPTIC_RT { return translation_; }
    [[nodiscard]] double rotation_energy() const HAPTIC_RT { return rotation_; }

  private:
    void observe(const PassivityMotion& motion, const PassivityWish& wish, bool wished) HAPTIC_RT;
    [[nodiscard]] Result bound(const PassivityMotion& motion, const PassivityWish& wish) HAPTIC_RT;
    [[nodiscard]] Result damp(const PassivityMotion& motion, const PassivityWish& wish) const HAPTIC_RT;

    PassivitySettings settings_;
    WrenchLimits limits_;
    double energy_ = 0.0;
    double tank_ = 0.0;  // the same with damping_credit
    double translation_ = 0.0;
    double rotation_ = 0.0;
    double scale_ = 1.0;
    double surface_power_ = 0.0;  // W, of the last tick, as far as it was rendered
};

/// The largest gamma in 0..1 for which holding gamma w for period_s and then ending it in gamma ramp_s costs at most
/// `budget`: power is w . v or 0, W; acceleration_power is |F|^2 / m + |T|^2 / I, W/s.
[[nodiscard]] double affordable_share(double power, double acceleration_power, double period_s, double ramp_s,
                                      double budget) HAPTIC_RT;

/// The stiffness up to which a sampled spring is passive: min(2 b / (T + 2 delay), 2 f / resolution), N/m; friction 0
/// is unknown, and its term is left out: the limit cycles that it forbids are one count wide.
/// @source Abbott and Okamura 2005, Effects of position quantization and sampling rate on virtual-wall passivity,
/// equation 2; with delay Diolaiti, Niemeyer, Barbagli and Salisbury 2006, b > K T / 2 + K delay.
[[nodiscard]] double passive_stiffness(double damping, double friction, double resolution, double period_s,
                                       double delay_s);

}  // namespace haptic::rt
