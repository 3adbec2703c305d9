#include "haptic/device/emulated_settings.hpp"

namespace haptic::device {

const SettingTable<EmulatedSettings>& emulated_settings() {
    using S = EmulatedSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "emulated",
        "The grip behind --device emulated. Except for mechanics, the keys are used with \"impedance\" and \"free\" "
        "only.",
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

std::optional<GripMechanics> read_emulated(const Config& config) {
    EmulatedSettings settings;
    emulated_settings().read(config, settings);
    return grip_mechanics(settings);
}

}  // namespace haptic::device
