// host-sim materials: lists the named materials.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <iomanip>
#include <iostream>
#include <string>
#include <tuple>
#include <vector>

#include "app/commands.hpp"
#include "app/material_tables.hpp"
#include "haptic/sim/material.hpp"
#include "program/exit_status.hpp"

namespace haptic::sim {
namespace {

using MaterialRow = std::array<std::string, 8>;

MaterialRow row_of(const NamedMaterial& material) {
    if (material.kind == MaterialKind::Solid) {
        const SolidMaterial& s = material.solid;
        return {std::string(material.name),
                "solid",
                with_unit(s.young_modulus, "Pa"),
                "-",
                with_unit(s.poisson_ratio, ""),
                with_unit(s.density, "") + " kg/m^3",
                with_unit(1e3 * s.damping, "") + " ms",
                std::string(material.source)};
    }
    const SheetMaterial& s = material.sheet;
    return {std::string(material.name),
            "sheet",
            with_unit(s.membrane_stiffness, "N/m"),
            with_unit(s.bending_stiffness, "N m"),
            with_unit(s.poisson_ratio, ""),
            with_unit(s.areal_density, "") + " kg/m^2",
            with_unit(1e3 * s.damping, "") + " ms",
            std::string(material.source)};
}

int run_materials() {
    std::vector<MaterialRow> rows{{"name", "kind", "stiffness", "bending", "Poisson", "density", "damping", "source"}};
    for (const NamedMaterial& material : named_materials()) {
        rows.push_back(row_of(material));
    }
    MaterialRow::size_type column = 0;
    std::array<int, std::tuple_size_v<MaterialRow>> width{};
    for (int& w : width) {
        for (const MaterialRow& row : rows) {
            w = std::max(w, static_cast<int>(row[column].size()));
        }
        ++column;
    }
    for (const MaterialRow& row : rows) {
        for (column = 0; column + 1 < row.size(); ++column) {
            std::cout << (column < 2 ? std::left : std::right) << std::setw(width[column]) << row[column] << "  ";
        }
        std::cout << row.back() << '\n';
    }
    return kExitDone;
}

}  // namespace

Command add_materials_command(CLI::App& app) {
    app.footer(
        "A scene takes one with model.material = \"NAME\". Stiffness is Young's modulus of a solid and membrane "
        "stiffness of a sheet; damping is the retardation time.");
    return [] { return run_materials(); };
}

}  // namespace haptic::sim
