// Passivity observer and controller at the grip: the rendered wrench may not give the hand more energy than it took in.
//
// Observer. The motors hold their tensions from one tick to the next, so the energy that the strings took from the grip
// in a tick is exactly the held wrench times the displacement, whatever the path in between:
//     E += -(F . dx + T . dtheta)                                 taken from the hand
//        + b |dx|^2 / dt + b_r |dtheta|^2 / dt                    dissipated at least by the device's own damping
//        + (P_s now + P_s before) / 2 dt,  P_s = sum f v_s        work of surfaces announced as moving, f the rows'
//                                                                 forces; of a receding one, E / (stored + store) of it
//        + min(B, stored + store - E)                             work that the bodies report, B > 0 what is left of it
//     E  = min(E, stored + store)                                 spring energy of the coupling, and a small allowance
// This holds while a wrench is asked for. Without one, surplus is discarded (E = min(E, 0)) and debt is forgotten
// slowly: energy stored in one contact permits nothing in the next.
//
// Work of moving surfaces. A moving object may do work on a resting hand. Its simulation answers a pose that is one to
// two steps old and knows the work that it did at that pose: frames report it (body_work). It goes to an account B,
// from which E is filled up as the springs gain energy, so a blow is credited when it is felt. Work that the bodies
// take makes B negative; it is paid back by energy that the springs release, and the rest by the next work of the
// bodies: it is never charged at once. So all that the hand is given is at most what the bodies have given. B > 0
// expires with the next frame, B < 0 with the time constant of a debt. Of frames that report nothing, the planes'
// velocities announce the work; a surface that moves unannounced then gets no credit. Fingers that close onto a surface
// always count as a surface that is announced as approaching.
//
// The last line of E bounds the effect of wrong reports, and of frames and stiffnesses that change the springs at an
// unchanged pose: energy that the springs gain is not credited, and what they lose cannot be given to the hand later.
// For a spring K held for a period T against a resting wall, E >= 0 if and only if K <= 2 b / T, for every motion:
// E = K d^2 / 2 + (b / T - K / 2) sum |dx|^2.
//
// Controller `Bound`. A wrench is begun or kept up only if it can also be ended. Going to zero at the rate limits takes
// gamma tau, tau = max(|F| / force_rate, |T| / torque_rate), after one tick of holding. In that time a released grip
// moves by v h + a h^2 / 2 on average, h = gamma (T + gamma tau / 2), so the wrench gamma w gives away
//     P h + Q h^2 / 2 <= E + allowance,    P = max(0, w . v),    Q = |F|^2 / m + |T|^2 / I
// and the largest gamma <= 1 has a closed form. gamma falls at once, and recovers with a time constant while the wrench
// does no work. A brake of (1 - gamma) d acts beside it, on the mean velocity of some ms, and the energy it takes is
// never given back, so that a vibration that was kept from growing decays. In an ideal contact (K < m / T^2, K v <
// force_rate) gamma is 1 and the wrench is the requested one, bit for bit. No wrench is made where none is asked for,
// whatever the debt: free motion stays exactly zero. gamma is computed with only `damping_credit` of the device's
// damping.
//
// Controller `Damp` is the original one: alpha v against the motion, which pays a debt back, bounded by what is stable
// at the sample rate, with separate observers for translation and rotation.
// @source Hannaford and Ryu 2002, Time-domain passivity control of haptic interfaces; Stramigioli, Secchi, van der
// Schaft and Fantuzzi 2005, Sampled data systems passivity and discrete port-Hamiltonian systems (energy over a tick is
// exact); Kim and Ryu 2010, energy bounding algorithm (credit for the device's damping); Franken, Stramigioli et al.
// 2011 (tank); Ryu, Artigas and Preusche 2010, A passive bilateral control scheme for a teleoperator with time-varying
// communication delay (two-port with delay). The account of the bodies and the bound by the cost of ending the
// wrench are ours.
#pragma once

#include <cstdint>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"
#include "rendering/limits.hpp"

namespace haptic::rt {

enum class PassivityControl : std::uint8_t {
    Observe,  // log only
    Bound,    // scale the wrench by gamma
    Damp      // add damping alpha
};

struct PassivitySettings {
    PassivityControl control = PassivityControl::Bound;
    double allowance = 4e-5;         // J, that a contact may give beyond what it took; far below perception
    double store = 1e-3;             // J, that may be kept beyond the energy of the coupling's springs
    double recovery_s = 0.05;        // s, time constant with which gamma recovers to 1
    double brake = 3.0;              // N s/m, against the grip's mean velocity at gamma = 0; stable below m / T = 100
    double rotational_brake = 6e-4;  // N m s/rad, of the rotation; I / T = 0.02
    double forget_s = 5.0;        // s, time constant with which debt is forgotten: E < 0 in free motion, B < 0 always
    double surface_power = 10.0;  // W, largest credited power of moving surfaces; 0: no credit
    double damping = 0.3;         // N s/m, damping that the device has at least
    double damping_credit = 0.5;  // 0..1, share of it that contacts may use; the rest makes vibration decay
    double rotational_damping = 6e-5;      // N m s/rad
    double mass = 0.1;                     // kg, of the grip alone: the smallest mass that the wrench may accelerate
    double inertia = 2e-5;                 // kg m^2
    double max_damping = 30.0;             // N s/m, largest alpha; m / T is 100, and half of that oscillates
    double max_rotational_damping = 6e-3;  // N m s/rad
};

/// Motion of the grip since the last tick, and the wrench held meanwhile.
struct PassivityMotion {
    Vec3 displacement{0.0, 0.0, 0.0};  // m, displacement of the grip
    Vec3 rotation{0.0, 0.0, 0.0};      // rad, rotation vector, device frame
    double elapsed_s = 0.0;            // s, duration; 0 if the pose was not measured
    Wrench held;                       // wrench of the strings meanwhile, mean of begin and end
    bool requested = false;            // the requested wrench was not zero
};

/// The wrench to be rendered now.
struct PassivityRequest {
    Wrench wrench;
    double stored = 0.0;         // J, in the springs of the coupling
    double surface_power = 0.0;  // W, that surfaces announced as moving put into the springs
    bool reported = false;       // a frame has reported the work of the bodies since the last tick
    double body_work = 0.0;      // J, that they put into the springs in its step
    double elapsed_s = 0.001;    // s, since the last tick
    double period_s = 0.001;     // s, from now until another wrench can replace this one
};

class Passivity {
  public:
    Passivity(const PassivitySettings& settings, const WrenchLimits& limits) : settings_(settings), limits_(limits) {}

    struct Result {
        Wrench wrench;
        double scale = 1.0;  // gamma
        bool acted = false;  // the wrench differs from the requested one
    };
    /// To be called once a tick. Returns the requested wrench bit for bit if it is zero or not limited. Input that is
    /// not finite gives zero.
    Result apply(const PassivityMotion& motion, const PassivityRequest& request) HAPTIC_RT;
    void reset() HAPTIC_RT;

    /// J, E as defined above, of translation and rotation together. Negative: energy given without having been taken.
    [[nodiscard]] double energy() const HAPTIC_RT { return energy_.energy; }
    [[nodiscard]] double translation_energy() const HAPTIC_RT { return translation_.energy; }
    [[nodiscard]] double rotation_energy() const HAPTIC_RT { return rotation_; }

  private:
    /// Energy of an observer, and what it exchanges with the bodies.
    struct Account {
        double energy = 0.0;  // J, E
        double bodies = 0.0;  // J, that the bodies have given and E has not been credited with; negative: have taken
    };
    void observe(const PassivityMotion& motion, const PassivityRequest& request, bool requested) HAPTIC_RT;
    [[nodiscard]] Result bound(const PassivityMotion& motion, const PassivityRequest& request) HAPTIC_RT;
    [[nodiscard]] Result damp(const PassivityMotion& motion, const PassivityRequest& request) const HAPTIC_RT;

    PassivitySettings settings_;
    WrenchLimits limits_;
    Account energy_;
    Account tank_;  // E with only damping_credit of the damping
    Account translation_;
    double rotation_ = 0.0;
    double scale_ = 1.0;
    Vec3 brake_velocity_{0.0};    // m/s, mean that the brake acts on
    Vec3 brake_turn_{0.0};        // rad/s
    double surface_power_ = 0.0;  // W, of the last tick, scaled like the rendered wrench
};

/// Largest gamma in 0..1 for which holding gamma w for period_s and then ending it in gamma ramp_s costs at most
/// `budget` (J). power: max(0, w . v), W; acceleration_power: |F|^2 / m + |T|^2 / I, W/s.
[[nodiscard]] double affordable_share(double power, double acceleration_power, double period_s, double ramp_s,
                                      double budget) HAPTIC_RT;

/// N/m, largest stiffness of a passive sampled spring: min(2 b / (T + 2 delay), 2 f / resolution). Friction f = 0 means
/// unknown; its term is then omitted, since the limit cycles that it prevents are one count wide.
/// @source Abbott and Okamura 2005, Effects of position quantization and sampling rate on virtual-wall passivity,
/// equation 2; with delay Diolaiti, Niemeyer, Barbagli and Salisbury 2006, b > K T / 2 + K delay.
[[nodiscard]] double passive_stiffness(double damping, double friction, double resolution, double period_s,
                                       double delay_s);

}  // namespace haptic::rt
