#include "app/body_argument.hpp"

#include <algorithm>

#include "haptic/setting.hpp"
#include "haptic/sim/mesh_file.hpp"
#include "model/generator_table.hpp"

namespace haptic::sim {

bool is_generator(const std::string& what) {
    return std::ranges::any_of(generator_table(), [&](const GeneratorEntry& entry) { return what == entry.name; });
}

bool is_mesh_file(const std::string& what) {
    try {
        static_cast<void>(mesh_format(what));
        return true;
    } catch (const MeshError&) {
        return false;
    }
}

Config config_of_body(const std::string& what) {
    if (is_generator(what)) {
        return Config::parse("[model]\ngenerator = " + toml_value(what) + "\n", "");
    }
    try {
        static_cast<void>(mesh_format(what));
    } catch (const MeshError& error) {
        throw MeshError(std::string(error.what()) + "; generated bodies are: " + generator_names());
    }
    return Config::parse("[model]\nfile = " + toml_value(what) + "\n", "");
}

}  // namespace haptic::sim
