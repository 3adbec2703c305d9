#include <haptic/device/emulated_config.hpp>

#include <string>

namespace haptic::device {

std::optional<GripMechanics> read_emulated(const Config& config) {
    GripMechanics m;
    const auto number = [&](const char* key, double& value, Range range) {
        value = config.number(std::string("emulated.") + key, value, range);
    };
    number("mass", m.mass, {0.001, 10.0});
    m.inertia = config.vec3("emulated.inertia", m.inertia, {1e-7, 0.1});
    number("damping", m.damping, {0.0, 100.0});
    number("rotational_damping", m.rotational_damping, {0.0, 1.0});
    number("string_stiffness", m.string_stiffness, {100.0, 1e6});
    number("string_damping", m.string_damping, {0.0, 100.0});
    number("motor_mass", m.motor_mass, {0.0001, 1.0});
    number("motor_drag", m.motor_drag, {0.0, 100.0});
    number("motor_friction", m.motor_friction, {0.0, 5.0});
    number("hand_stiffness", m.hand_stiffness, {0.0, 1e5});
    number("hand_damping", m.hand_damping, {0.0, 1000.0});
    number("hand_rotational_stiffness", m.hand_rotational_stiffness, {0.0, 100.0});
    number("hand_rotational_damping", m.hand_rotational_damping, {0.0, 1.0});
    const std::string chosen = config.choice("emulated.mechanics", "ideal", {"ideal", "impedance", "free"});
    m.hand = chosen == "free" ? Hand::Free : Hand::Impedance;
    return chosen == "ideal" ? std::nullopt : std::optional(m);
}

}  // namespace haptic::device
