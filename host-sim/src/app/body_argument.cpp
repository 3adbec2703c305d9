#include "app/body_argument.hpp"

#include <algorithm>

#include "haptic/setting.hpp"
#include "haptic/sim/mesh_file.hpp"
#include "model/generator_table.hpp"

namespace haptic::sim {

namespace {

bool is_generator(const std::string& what) {
    return std::ranges::any_of(generator_table(), [&](const GeneratorEntry& entry) { return what == entry.name; });
}

/// Why a name has not the extension of a mesh file; "" if it has.
std::string mesh_problem(const std::string& what) {
    try {
        static_cast<void>(mesh_format(what));
        return "";
    } catch (const MeshError& error) {
        return error.what();
    }
}

}  // namespace

bool is_body(const std::string& what) {
    return is_generator(what) || mesh_problem(what).empty();
}

Config config_of_body(const std::string& what) {
    if (is_generator(what)) {
        return Config::parse("[model]\ngenerator = " + toml_value(what) + "\n", "");
    }
    if (const std::string problem = mesh_problem(what); !problem.empty()) {
        throw MeshError(problem + "; generated bodies are: " + generator_names());
    }
    return Config::parse("[model]\nfile = " + toml_value(what) + "\n", "");
}

}  // namespace haptic::sim
