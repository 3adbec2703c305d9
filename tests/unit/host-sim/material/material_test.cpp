#include "haptic/sim/material.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <limits>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace haptic::sim {
namespace {

using testing::HasSubstr;

constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinite = std::numeric_limits<double>::infinity();

template <typename Material>
std::string material_refusal(const Material& material) {
    try {
        check(material);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "accepted";
}

/// A value with a unit of the thousands that fits, as in the table of the documentation.
std::string in_thousands(double value, const std::vector<std::string>& units) {
    std::size_t k = 0;
    while (value >= 1000.0 && k + 1 < units.size()) {
        value /= 1000.0;
        ++k;
    }
    std::ostringstream text;
    text << value << ' ' << units[k];
    return text.str();
}

/// Rows of both tables in docs/materials.md.
std::vector<std::string> expected_rows() {
    std::vector<std::string> rows;
    for (const NamedMaterial& material : named_materials()) {
        std::ostringstream row;
        row << "| `" << material.name << "` | ";
        if (material.kind == MaterialKind::Solid) {
            const SolidMaterial& s = material.solid;
            row << in_thousands(s.young_modulus, {"Pa", "kPa", "MPa"}) << " | " << s.poisson_ratio << " | " << s.density
                << " | " << 1e3 * s.damping;
        } else {
            const SheetMaterial& s = material.sheet;
            row << in_thousands(s.membrane_stiffness, {"N/m", "kN/m"}) << " | " << 1e6 * s.bending_stiffness << " | "
                << s.poisson_ratio << " | " << 1e3 * s.areal_density << " | " << 1e3 * s.damping;
        }
        row << " | " << material.source << " |";
        rows.push_back(row.str());
    }
    return rows;
}

TEST(Material, NamedOnesAreValidAndHaveASource) {
    for (const NamedMaterial& material : named_materials()) {
        EXPECT_NO_THROW(check(material.solid)) << material.name;
        EXPECT_NO_THROW(check(material.sheet)) << material.name;
        EXPECT_FALSE(material.source.empty()) << material.name;
    }
}

TEST(Material, NamesAreUniqueLowerCaseAndSortedWithinTheirKind) {
    const auto materials = named_materials();
    std::set<std::string_view> names;
    for (const NamedMaterial& material : materials) {
        EXPECT_TRUE(names.insert(material.name).second) << material.name;
        EXPECT_TRUE(std::none_of(material.name.begin(), material.name.end(), [](char c) {
            return c >= 'A' && c <= 'Z';
        })) << material.name;
    }
    EXPECT_TRUE(std::is_sorted(materials.begin(), materials.end(), [](const auto& a, const auto& b) {
        return a.kind != b.kind ? a.kind == MaterialKind::Solid : a.name < b.name;
    }));
}

TEST(Material, IsFoundByItsName) {
    for (const NamedMaterial& material : named_materials()) {
        EXPECT_EQ(&find_material(material.name), &material);
    }
    EXPECT_EQ(find_material("liver").kind, MaterialKind::Solid);
    EXPECT_EQ(find_material("cotton").kind, MaterialKind::Sheet);
}

TEST(Material, AnUnknownNameIsRefusedWithAllNames) {
    for (const char* name : {"", "Liver", "livers", "unobtainium"}) {
        try {
            (void)find_material(name);
            ADD_FAILURE() << name << " was found";
        } catch (const std::invalid_argument& error) {
            EXPECT_THAT(error.what(), HasSubstr('"' + std::string(name) + '"'));
            for (const NamedMaterial& material : named_materials()) {
                EXPECT_THAT(error.what(), HasSubstr(std::string(material.name)));
            }
        }
    }
}

TEST(Material, EachWrongValueOfASolidIsNamed) {
    EXPECT_EQ(material_refusal(SolidMaterial{}), "accepted");
    EXPECT_EQ(material_refusal(SolidMaterial{.poisson_ratio = 0.0}), "accepted");
    EXPECT_EQ(material_refusal(SolidMaterial{.poisson_ratio = kMaxPoissonRatio}), "accepted");
    for (const double bad : {0.0, -1.0, kNotANumber, kInfinite}) {
        EXPECT_THAT(material_refusal(SolidMaterial{.young_modulus = bad}), HasSubstr("young_modulus"));
        EXPECT_THAT(material_refusal(SolidMaterial{.density = bad}), HasSubstr("density"));
    }
    for (const double bad : {-0.01, std::nextafter(kMaxPoissonRatio, 1.0), 0.5, kNotANumber}) {
        EXPECT_THAT(material_refusal(SolidMaterial{.poisson_ratio = bad}), HasSubstr("0 to 0.48"));
    }
    for (const double bad : {-1e-9, kNotANumber, kInfinite}) {
        EXPECT_THAT(material_refusal(SolidMaterial{.damping = bad}), HasSubstr("damping"));
    }
    EXPECT_EQ(material_refusal(SolidMaterial{.density = -1.0}),
              "solid material: density is -1.0, must be positive, kg/m^3");
}

TEST(Material, EachWrongValueOfASheetIsNamed) {
    EXPECT_EQ(material_refusal(SheetMaterial{}), "accepted");
    EXPECT_EQ(material_refusal(SheetMaterial{.bending_stiffness = 0.0}), "accepted");
    for (const double bad : {0.0, -1.0, kNotANumber, kInfinite}) {
        EXPECT_THAT(material_refusal(SheetMaterial{.membrane_stiffness = bad}), HasSubstr("membrane_stiffness"));
        EXPECT_THAT(material_refusal(SheetMaterial{.areal_density = bad}), HasSubstr("areal_density"));
    }
    for (const double bad : {-0.01, 0.49, kNotANumber}) {
        EXPECT_THAT(material_refusal(SheetMaterial{.poisson_ratio = bad}), HasSubstr("0 to 0.48"));
    }
    for (const double bad : {-1e-9, kNotANumber, kInfinite}) {
        EXPECT_THAT(material_refusal(SheetMaterial{.bending_stiffness = bad}), HasSubstr("bending_stiffness"));
        EXPECT_THAT(material_refusal(SheetMaterial{.damping = bad}), HasSubstr("damping"));
    }
}

TEST(Material, TablesOfTheDocumentationHaveTheSameValues) {
    std::ifstream page(HOST_SIM_DOCS "/materials.md");
    ASSERT_TRUE(page.is_open());
    std::vector<std::string> rows;
    for (std::string line; std::getline(page, line);) {
        if (line.starts_with("| `")) {
            rows.push_back(line);
        }
    }
    EXPECT_EQ(rows, expected_rows());
}

}  // namespace
}  // namespace haptic::sim
