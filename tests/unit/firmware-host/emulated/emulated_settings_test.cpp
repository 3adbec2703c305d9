#include "haptic/device/emulated_settings.hpp"

#include <gtest/gtest.h>

namespace haptic::device {
namespace {

TEST(EmulatedSettings, HandIsIdealUnlessSaidOtherwise) {
    EXPECT_FALSE(grip_mechanics(read_emulated(Config())).has_value());
    EXPECT_TRUE(read_emulated(Config()).tremor.still());
    EXPECT_FALSE(
        grip_mechanics(read_emulated(Config::parse("[emulated]\nmechanics = 'ideal'\nmass = 0.3", "t"))).has_value());
}

TEST(EmulatedSettings, EachKeySetsWhatItsNameSays) {
    const Config config = Config::parse(R"(
[emulated]
mechanics = "free"
mass = 0.2
inertia = [1e-5, 2e-5, 3e-5]
damping = 0.4
rotational_damping = 0.001
string_stiffness = 5000
string_damping = 1.5
motor_mass = 0.01
motor_drag = 0.1
motor_friction = 0.03
hand_stiffness = 700
hand_damping = 7
hand_rotational_stiffness = 2
hand_rotational_damping = 0.02
tremor = 1e-4
tremor_rotation = 0.002
drift = 0.001
drift_rotation = 0.01
tremor_seed = 7
)",
                                        "t");
    const EmulatedSettings settings = read_emulated(config);
    const auto m = grip_mechanics(settings);
    ASSERT_TRUE(m.has_value());
    EXPECT_EQ(m->hand, Hand::Free);
    EXPECT_EQ(m->mass, 0.2);
    EXPECT_EQ(m->inertia, Vec3(1e-5, 2e-5, 3e-5));
    EXPECT_EQ(m->damping, 0.4);
    EXPECT_EQ(m->rotational_damping, 0.001);
    EXPECT_EQ(m->string_stiffness, 5000.0);
    EXPECT_EQ(m->string_damping, 1.5);
    EXPECT_EQ(m->motor_mass, 0.01);
    EXPECT_EQ(m->motor_drag, 0.1);
    EXPECT_EQ(m->motor_friction, 0.03);
    EXPECT_EQ(m->hand_stiffness, 700.0);
    EXPECT_EQ(m->hand_damping, 7.0);
    EXPECT_EQ(m->hand_rotational_stiffness, 2.0);
    EXPECT_EQ(m->hand_rotational_damping, 0.02);
    EXPECT_EQ(settings.tremor.position, 1e-4);
    EXPECT_EQ(settings.tremor.rotation, 0.002);
    EXPECT_EQ(settings.tremor.drift, 0.001);
    EXPECT_EQ(settings.tremor.drift_rotation, 0.01);
    EXPECT_EQ(settings.tremor.seed, 7U);
    EXPECT_NO_THROW(config.reject_unknown());
}

TEST(EmulatedSettings, RefusesWhatIsNoMechanicsWithItsLine) {
    try {
        static_cast<void>(read_emulated(Config::parse("[emulated]\nmechanics = 'stiff'", "f.toml")));
        FAIL() << "taken";
    } catch (const ConfigError& error) {
        EXPECT_EQ(std::string(error.what()).substr(0, 9), "f.toml:2:") << error.what();
    }
    EXPECT_THROW(static_cast<void>(read_emulated(Config::parse("[emulated]\nmass = 0", "t"))), ConfigError);
}

}  // namespace
}  // namespace haptic::device
