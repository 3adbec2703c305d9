// Argument of a command that is a body without a scene: the name of a generator, or a mesh file.
#pragma once

#include <string>

#include "haptic/config.hpp"

namespace haptic::sim {

/// Whether a name is that of a generator, or has the extension of a mesh file.
[[nodiscard]] bool is_body(const std::string& what);

/// A configuration whose [model] is that body; errors about its keys have no line. Throws MeshError that lists the
/// generators for the name of neither a generator nor a mesh file.
[[nodiscard]] Config config_of_body(const std::string& what);

}  // namespace haptic::sim
