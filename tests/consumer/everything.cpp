// Uses one function of each library, so that whatever they need of one another or of others must come with the package.
#include <exception>
#include <haptic/device/device_geometry.hpp>
#include <haptic/sim/scene.hpp>
#include <iostream>
#include <string>

int main() {
    try {
        const haptic::device::DeviceGeometry geometry = haptic::device::spidar_g6_x3r();
        static_cast<void>(geometry);
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
