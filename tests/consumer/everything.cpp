// Uses one function of each library, so that whatever they need of one another or of others must come with the package.
#include <exception>
#include <haptic/config.hpp>
#include <haptic/device/variant.hpp>
#include "process/settings.hpp"
#include <haptic/sim/scene.hpp>
#include <iostream>
#include <string>

int main() {
    try {
        const haptic::Config config = haptic::Config::parse(haptic::rt::default_config_text(), "default");
        static_cast<void>(haptic::rt::read_settings(config));
        const haptic::device::Variant variant = haptic::device::spidar_g6_x3r();
        static_cast<void>(variant);
        for (const haptic::sim::BuiltInScene& scene : haptic::sim::built_in_scenes()) {
            const std::string name(scene.name);
            static_cast<void>(haptic::sim::read_scene(haptic::sim::open_scene(name), name));
        }
        return 0;
    } catch (const std::exception& error) {
        std::cerr << error.what() << '\n';
        return 1;
    }
}
