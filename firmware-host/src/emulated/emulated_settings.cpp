#include "haptic/device/emulated_settings.hpp"

namespace haptic::device {

const SettingTable<EmulatedSettings>& emulated_settings() {
    using S = EmulatedSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "emulated",
        "The grip behind --device emulated, and the hand that holds it. Except for mechanics and the tremor of the "
        "hand, the keys are used with \"impedance\" and \"free\" only.",
        {
            {{.key = "mechanics",
              .meaning = "\"ideal\": the grip follows its recording exactly. \"impedance\": it is a rigid body in "
                         "elastic strings, held by a compliant hand. \"free\": the same without a hand; it is held "
                         "until the loop runs and then released."},
             V::choice(&S::mechanics, {{"ideal", EmulatedMechanics::Ideal},
                                       {"impedance", EmulatedMechanics::Impedance},
                                       {"free", EmulatedMechanics::Free}})},
            {{.key = "mass",
              .unit = "kg",
              .meaning = "Mass of the grip and of the part of the hand that moves with it."},
             V::number([](S& s) -> auto& { return s.grip.mass; }, {0.001, 10.0})},
            {{.key = "inertia",
              .unit = "kg*m^2",
              .meaning = "Principal moments of inertia of the grip about its axes."},
             V::vector([](S& s) -> auto& { return s.grip.inertia; }, {1e-7, 0.1})},
            {{.key = "damping", .unit = "N*s/m", .meaning = "Viscous damping of the grip's translation."},
             V::number([](S& s) -> auto& { return s.grip.damping; }, {0.0, 100.0})},
            {{.key = "rotational_damping", .unit = "N*m*s/rad", .meaning = "Viscous damping of the grip's rotation."},
             V::number([](S& s) -> auto& { return s.grip.rotational_damping; }, {0.0, 1.0})},
            {{.key = "string_stiffness", .unit = "N/m", .meaning = "Stiffness of each string."},
             V::number([](S& s) -> auto& { return s.grip.string_stiffness; }, {100.0, 1e6})},
            {{.key = "string_damping", .unit = "N*s/m", .meaning = "Damping of each string along its length."},
             V::number([](S& s) -> auto& { return s.grip.string_damping; }, {0.0, 100.0})},
            {{.key = "motor_mass",
              .unit = "kg",
              .meaning = "Inertia of a motor's rotor, as an equivalent mass at the string."},
             V::number([](S& s) -> auto& { return s.grip.motor_mass; }, {0.0001, 1.0})},
            {{.key = "motor_drag", .unit = "N*s/m", .meaning = "Viscous drag of a motor, at the string."},
             V::number([](S& s) -> auto& { return s.grip.motor_drag; }, {0.0, 100.0})},
            {{.key = "motor_friction", .unit = "N", .meaning = "Coulomb friction of a motor, at the string."},
             V::number([](S& s) -> auto& { return s.grip.motor_friction; }, {0.0, 5.0})},
            {{.key = "hand_stiffness", .unit = "N/m", .meaning = "Stiffness of the hand."},
             V::number([](S& s) -> auto& { return s.grip.hand_stiffness; }, {0.0, 1e5})},
            {{.key = "hand_damping", .unit = "N*s/m", .meaning = "Damping of the hand."},
             V::number([](S& s) -> auto& { return s.grip.hand_damping; }, {0.0, 1000.0})},
            {{.key = "hand_rotational_stiffness", .unit = "N*m/rad", .meaning = "Rotational stiffness of the hand."},
             V::number([](S& s) -> auto& { return s.grip.hand_rotational_stiffness; }, {0.0, 100.0})},
            {{.key = "hand_rotational_damping", .unit = "N*m*s/rad", .meaning = "Rotational damping of the hand."},
             V::number([](S& s) -> auto& { return s.grip.hand_rotational_damping; }, {0.0, 1.0})},
            {{.key = "tremor",
              .unit = "m",
              .meaning = "Largest displacement of the hand along each axis by physiological tremor of 8 to 12 Hz. "
                         "Common is 0.0001."},
             V::number([](S& s) -> auto& { return s.tremor.position; }, {0.0, 0.01})},
            {{.key = "tremor_rotation", .unit = "rad", .meaning = "The same about each axis."},
             V::number([](S& s) -> auto& { return s.tremor.rotation; }, {0.0, 0.2})},
            {{.key = "drift",
              .unit = "m",
              .meaning = "Largest displacement of the hand along each axis by slow drift of 0.1 to 0.5 Hz."},
             V::number([](S& s) -> auto& { return s.tremor.drift; }, {0.0, 0.05})},
            {{.key = "drift_rotation", .unit = "rad", .meaning = "The same about each axis."},
             V::number([](S& s) -> auto& { return s.tremor.drift_rotation; }, {0.0, 0.5})},
            {{.key = "tremor_seed", .meaning = "Seed of the frequencies and phases of tremor and drift."},
             V::integer([](S& s) -> auto& { return s.tremor.seed; }, {0.0, 4294967295.0})},
        }};
    return table;
}

std::optional<GripMechanics> grip_mechanics(const EmulatedSettings& settings) {
    if (settings.mechanics == EmulatedMechanics::Ideal) {
        return std::nullopt;
    }
    GripMechanics grip = settings.grip;
    grip.hand = settings.mechanics == EmulatedMechanics::Free ? Hand::Free : Hand::Impedance;
    return grip;
}

EmulatedSettings read_emulated(const Config& config) {
    EmulatedSettings settings;
    emulated_settings().read(config, settings);
    return settings;
}

}  // namespace haptic::device
