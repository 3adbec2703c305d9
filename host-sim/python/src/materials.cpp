// haptic.materials and the virtual tests of `host-sim material`.

#include <pybind11/stl.h>

#include <cstddef>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "haptic/setting.hpp"
#include "haptic/sim/material.hpp"
#include "specimens/bar_tests.hpp"
#include "specimens/press_tests.hpp"
#include "specimens/sheet_tests.hpp"

namespace haptic::python {
namespace {

using Unlocked = py::call_guard<py::gil_scoped_release>;

std::string text_of(const sim::SolidMaterial& m) {
    return "SolidMaterial(young_modulus=" + toml_value(m.young_modulus) +
           ", poisson_ratio=" + toml_value(m.poisson_ratio) + ", density=" + toml_value(m.density) +
           ", damping=" + toml_value(m.damping) + ")";
}

std::string text_of(const sim::SheetMaterial& m) {
    return "SheetMaterial(membrane_stiffness=" + toml_value(m.membrane_stiffness) +
           ", bending_stiffness=" + toml_value(m.bending_stiffness) + ", poisson_ratio=" + toml_value(m.poisson_ratio) +
           ", areal_density=" + toml_value(m.areal_density) + ", damping=" + toml_value(m.damping) + ")";
}

sim::BarTest bar_of(const sim::SolidMaterial& material, std::size_t particles, double step, int substeps) {
    check(material);
    return {.material = material, .particles = particles, .step = step, .substeps = substeps};
}

sim::SheetTest sheet_of(const sim::SheetMaterial& material, std::uint32_t vertices, double side, double step,
                        int substeps) {
    check(material);
    if (vertices < sim::SheetTest::kFewestPerSide) {
        throw py::value_error("vertices_per_side must be at least " + std::to_string(sim::SheetTest::kFewestPerSide) +
                              ", found " + std::to_string(vertices));
    }
    return {.material = material,
            .vertices_per_side = vertices,
            .side = side,
            .strip = side / 3.0,
            .step = step,
            .substeps = substeps};
}

template <class Test>
void bind_bar_test(py::module_& module, const char* name, Test test, const char* doc) {
    module.def(
        name,
        [test](const sim::SolidMaterial& material, std::size_t particles, double step, int substeps) {
            return test(bar_of(material, particles, step, substeps));
        },
        py::arg("material"), py::kw_only(), py::arg("particles") = 500, py::arg("step") = 0.01, py::arg("substeps") = 0,
        Unlocked(), doc);
}

template <class Test>
void bind_sheet_test(py::module_& module, const char* name, Test test, const char* doc) {
    module.def(
        name,
        [test](const sim::SheetMaterial& material, std::uint32_t vertices, double side, double step, int substeps) {
            return test(sheet_of(material, vertices, side, step, substeps));
        },
        py::arg("material"), py::kw_only(), py::arg("vertices_per_side") = 33, py::arg("side") = 0.3,
        py::arg("step") = 0.01, py::arg("substeps") = 0, Unlocked(), doc);
}

void bind_results(py::module_& module) {
    using sim::Drape;
    using sim::Measured;
    using sim::PressMeasured;
    using sim::SheetMeasured;
    py::class_<Measured>(module, "BarMeasured", "What a bar was measured to have.")
        .def_readonly("modulus", &Measured::modulus, "Pa")
        .def_readonly("poisson_ratio", &Measured::poisson_ratio, "of tension")
        .def_readonly("substeps", &Measured::substeps, "of a step, used")
        .def_readonly("simulated_s", &Measured::simulated_s, "s, until it was at rest")
        .def_readonly("at_rest", &Measured::at_rest);
    py::class_<SheetMeasured>(module, "SheetMeasured", "What a sheet was measured to have.")
        .def_readonly("value", &SheetMeasured::value, "N/m or N m")
        .def_readonly("poisson_ratio", &SheetMeasured::poisson_ratio, "of the membrane")
        .def_readonly("areal_density", &SheetMeasured::areal_density, "kg/m^2")
        .def_readonly("substeps", &SheetMeasured::substeps, "of a step, used")
        .def_readonly("simulated_s", &SheetMeasured::simulated_s, "s, until it was at rest")
        .def_readonly("at_rest", &SheetMeasured::at_rest);
    py::class_<Drape>(module, "Drape", "How a disc of cloth drapes over a smaller one.")
        .def_readonly("coefficient", &Drape::coefficient, "0..1, (area of the shadow - support) / (disc - support)")
        .def_readonly("folds", &Drape::folds, "maxima of the height along the edge")
        .def_readonly("simulated_s", &Drape::simulated_s, "s, until it was at rest")
        .def_readonly("at_rest", &Drape::at_rest)
        .def_property_readonly(
            "vertices", [](const py::object& self) { return view(self.cast<const Drape&>().mesh.vertices, self); },
            "(V, 3), m, as it hangs; read-only")
        .def_property_readonly(
            "triangles", [](const py::object& self) { return view(self.cast<const Drape&>().mesh.triangles, self); },
            "(T, 3); read-only");
    py::class_<PressMeasured>(module, "PressMeasured", "A layer's answer to a sphere pressed into it.")
        .def_readonly("depth", &PressMeasured::depth, "m")
        .def_readonly("force", &PressMeasured::force, "N, on the sphere")
        .def_readonly("requested", &PressMeasured::requested, "N, of the layer in theory")
        .def_readonly("touching", &PressMeasured::touching, "vertices that carry it")
        .def_readonly("substeps", &PressMeasured::substeps, "of a step, used")
        .def_readonly("at_rest", &PressMeasured::at_rest);
}

}  // namespace

void bind_materials(py::module_& module) {
    using sim::SheetMaterial;
    using sim::SolidMaterial;
    py::class_<SolidMaterial>(module, "SolidMaterial", "An isotropic, linearly elastic, viscous solid.")
        .def(py::init([](double young_modulus, double poisson_ratio, double density, double damping) {
                 const SolidMaterial made{young_modulus, poisson_ratio, density, damping};
                 check(made);
                 return made;
             }),
             py::kw_only(), py::arg("young_modulus") = SolidMaterial{}.young_modulus,
             py::arg("poisson_ratio") = SolidMaterial{}.poisson_ratio, py::arg("density") = SolidMaterial{}.density,
             py::arg("damping") = SolidMaterial{}.damping)
        .def_readonly("young_modulus", &SolidMaterial::young_modulus, "Pa")
        .def_readonly("poisson_ratio", &SolidMaterial::poisson_ratio)
        .def_readonly("density", &SolidMaterial::density, "kg/m^3")
        .def_readonly("damping", &SolidMaterial::damping, "s, retardation time")
        .def("__repr__", [](const SolidMaterial& m) { return text_of(m); });
    py::class_<SheetMaterial>(module, "SheetMaterial", "A thin, isotropic, linearly elastic, viscous sheet.")
        .def(py::init([](double membrane, double bending, double poisson_ratio, double density, double damping) {
                 const SheetMaterial made{membrane, bending, poisson_ratio, density, damping};
                 check(made);
                 return made;
             }),
             py::kw_only(), py::arg("membrane_stiffness") = SheetMaterial{}.membrane_stiffness,
             py::arg("bending_stiffness") = SheetMaterial{}.bending_stiffness,
             py::arg("poisson_ratio") = SheetMaterial{}.poisson_ratio,
             py::arg("areal_density") = SheetMaterial{}.areal_density, py::arg("damping") = SheetMaterial{}.damping)
        .def_readonly("membrane_stiffness", &SheetMaterial::membrane_stiffness, "N/m")
        .def_readonly("bending_stiffness", &SheetMaterial::bending_stiffness, "N m")
        .def_readonly("poisson_ratio", &SheetMaterial::poisson_ratio)
        .def_readonly("areal_density", &SheetMaterial::areal_density, "kg/m^2")
        .def_readonly("damping", &SheetMaterial::damping, "s, retardation time")
        .def("__repr__", [](const SheetMaterial& m) { return text_of(m); });
    module.def(
        "materials",
        [] {
            py::dict all;
            for (const sim::NamedMaterial& material : sim::named_materials()) {
                const py::str name{std::string(material.name)};
                if (material.kind == sim::MaterialKind::Solid) {
                    all[name] = material.solid;
                } else {
                    all[name] = material.sheet;
                }
            }
            return all;
        },
        "The named materials of scene files, as SolidMaterial or SheetMaterial; `host-sim materials` has their "
        "sources.");

    bind_results(module);
    bind_bar_test(module, "measure_tension", &sim::measure_tension,
                  "Young's modulus and Poisson's ratio of a bar of 0.4 x 0.05 x 0.05 m whose ends are pulled.");
    bind_bar_test(module, "measure_bending", &sim::measure_bending,
                  "Young's modulus of a bar of 0.4 x 0.05 x 0.05 m that sags by its weight (Timoshenko 1921).");
    bind_bar_test(module, "measure_torsion", &sim::measure_torsion,
                  "Shear modulus of a bar of 0.4 x 0.05 x 0.05 m that is twisted.");
    bind_sheet_test(module, "measure_membrane", &sim::measure_membrane,
                    "Membrane stiffness, N/m, and Poisson's ratio of a square that is pulled.");
    bind_sheet_test(module, "measure_sheet_bending", &sim::measure_sheet_bending,
                    "Bending stiffness, N m, of a strip that sags by its weight.");
    bind_sheet_test(module, "measure_drape", &sim::measure_drape,
                    "Drape of a disc of 0.15 m radius over a support of 0.09 m (Cusick 1965).");
    module.def(
        "measure_press",
        [](const SolidMaterial& material, const std::vector<double>& depths, std::size_t particles, double step,
           int substeps) {
            check(material);
            sim::PressTest test;
            test.contact.material = material;
            test.particles = particles;
            test.step = step;
            test.substeps = substeps;
            return sim::measure_press(test, depths);
        },
        py::arg("material"), py::arg("depths"), py::kw_only(), py::arg("particles") = 1000, py::arg("step") = 0.01,
        py::arg("substeps") = 0, Unlocked(),
        "Presses a sphere of 0.2 m radius into a layer of 0.05 m to each depth, m, in turn.");
}

}  // namespace haptic::python
