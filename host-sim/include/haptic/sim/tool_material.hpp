// Material of a tool: what its particles' shape resists with.
#pragma once

namespace haptic::sim {

/// Table [tool.material] of a scene.
struct ToolMaterial {
    static constexpr double kMaxYoungModulus = 1e10;  // Pa; stiffer than that is rigid
    static constexpr double kMaxPoissonRatio = 0.49;

    double young_modulus =
        1e5;  // Pa, 0 to kMaxYoungModulus. 0: limp. Silicone 1e5 to 1e6, rubber 1e6 to 1e7, wood 1e10
    double poisson_ratio = 0.4;  // 0 to kMaxPoissonRatio. Rubber 0.49, steel 0.3, cork 0
    bool rigid = false;          // no deformation at all, whatever the modulus

    [[nodiscard]] bool limp() const noexcept { return !rigid && young_modulus == 0.0; }
};

}  // namespace haptic::sim
