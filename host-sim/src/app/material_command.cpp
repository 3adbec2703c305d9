// host-sim material: tests a material, or the bodies of a scene, virtually, and compares with what was asked for.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "app/body_argument.hpp"
#include "app/commands.hpp"
#include "app/material_tables.hpp"
#include "app/run_options.hpp"
#include "edit_distance.hpp"
#include "haptic/clock.hpp"
#include "haptic/config.hpp"
#include "haptic/sim/mesh_file.hpp"
#include "haptic/sim/model_settings.hpp"
#include "haptic/sim/scene.hpp"
#include "material/moduli.hpp"
#include "model/generator_table.hpp"
#include "model/material_settings.hpp"
#include "program/exit_status.hpp"
#include "program/option_checks.hpp"
#include "program/progress_bar.hpp"
#include "program/results.hpp"
#include "specimens/bar_tests.hpp"
#include "specimens/body_tests.hpp"
#include "specimens/layer_contact.hpp"
#include "specimens/press_tests.hpp"
#include "specimens/sheet_tests.hpp"

namespace haptic::sim {
namespace {

constexpr double kFewestParticles = 60.0;  // of a bar: fewer have one particle across it
constexpr double kMostParticles = 5000.0;
constexpr double kFewestPressed = 100.0;  // particles of a layer: fewer have one or two under the sphere
constexpr double kMostPressed = 4000.0;   // more have more vertices under it than a contact problem has rows
constexpr std::array kShownSteps{0.001, 0.002, 0.005, 0.01, 0.02};  // s
constexpr std::array kPressDepths{0.001, 0.0015, 0.002, 0.0025};    // m

struct MaterialOptions {
    std::string what;
    std::vector<std::string> assignments;
    std::vector<std::size_t> particles{120, 250, 500};
    std::vector<std::size_t> pressed{300, 1000, 3000};
    std::string out;
};

/// Steps as the scene has them.
struct Stepping {
    double step = 0.01;
    int substeps = 0;
};

/// Runs tests one by one, each with its time, under a progress bar.
class TestSeries {
  public:
    TestSeries(const std::string& what, std::size_t tests) : bar_("testing " + what), tests_(tests) {}

    /// The result of `test`, and the seconds that it took.
    template <class Test>
    auto run(const Test& test) {
        bar_.show(static_cast<double>(done_) / static_cast<double>(tests_));
        const std::int64_t begin_ns = monotonic_now_ns();
        auto result = test();
        ++done_;
        return std::pair(result, 1e-9 * static_cast<double>(monotonic_now_ns() - begin_ns));
    }

  private:
    ProgressBar bar_;
    std::size_t tests_;
    std::size_t done_ = 0;
};

std::string count_of(std::size_t particles) {
    return std::to_string(particles) + " particles";
}

/// Adds what one test found to a table.
template <class Found>
void add_line(TestTable& table, const std::string& specimen, double number, const char* quantity, const char* unit,
              std::optional<double> requested, double measured, const Found& of, double time_s) {
    table.lines.push_back({.specimen = specimen,
                           .number = number,
                           .quantity = quantity,
                           .unit = unit,
                           .requested = requested,
                           .measured = measured,
                           .substeps = of.substeps,
                           .time_s = time_s,
                           .at_rest = of.at_rest});
}

/// A bar of this material at several resolutions.
TestTable test_bars(const SolidMaterial& material, const std::string& name, const MaterialOptions& options,
                    const Stepping& stepping) {
    TestTable table{.name = "bars", .title = "bars of " + name + ", 0.4 x 0.05 x 0.05 m:", .lines = {}};
    TestSeries series("bars of " + name, 3 * options.particles.size());
    for (const std::size_t particles : options.particles) {
        const BarTest test{
            .material = material, .particles = particles, .step = stepping.step, .substeps = stepping.substeps};
        const auto add = [&](const char* quantity, const char* unit, double requested, double measured,
                             const Measured& of, double time_s) {
            add_line(table, count_of(particles), static_cast<double>(particles), quantity, unit, requested, measured,
                     of, time_s);
        };
        const auto [pulled, pulled_s] = series.run([&] { return measure_tension(test); });
        add("Young's modulus in tension", "Pa", material.young_modulus, pulled.modulus, pulled, pulled_s);
        add("Poisson's ratio", "", material.poisson_ratio, pulled.poisson_ratio, pulled, pulled_s);
        const auto [bent, bent_s] = series.run([&] { return measure_bending(test); });
        add("Young's modulus in bending", "Pa", material.young_modulus, bent.modulus, bent, bent_s);
        const auto [twisted, twisted_s] = series.run([&] { return measure_torsion(test); });
        add("shear modulus in torsion", "Pa", shear_modulus(material), twisted.modulus, twisted, twisted_s);
    }
    return table;
}

/// The first of the bars at several steps, with sub-steps as chosen.
TestTable test_steps(const SolidMaterial& material, const std::string& name, std::size_t particles) {
    TestTable table{.name = "steps",
                    .title = "stiffness over steps, bar of " + count_of(particles) + " of " + name + ":",
                    .lines = {}};
    TestSeries series("steps of " + name, kShownSteps.size());
    for (const double step : kShownSteps) {
        const auto [pulled, time_s] = series.run([&] {
            return measure_tension({.material = material, .particles = particles, .step = step, .substeps = 0});
        });
        add_line(table, "step of " + with_unit(step, "s"), 1e3 * step, "Young's modulus in tension", "Pa",
                 material.young_modulus, pulled.modulus, pulled, time_s);
    }
    return table;
}

struct PressResult {
    PressTable forces;
    TestTable moduli;
};

/// A sphere pressed into a layer of this material at several resolutions.
PressResult test_press(const SolidMaterial& material, const std::string& name, const MaterialOptions& options,
                       const Stepping& stepping) {
    PressTest test;
    test.contact.material = material;
    test.step = stepping.step;
    test.substeps = stepping.substeps;
    const LayerContact& contact = test.contact;
    const std::string what = "sphere of radius " + with_unit(contact.radius, "m") + " pressed into a layer of " + name;
    PressResult result{.forces = {.name = "press",
                                  .title = what + ", " + with_unit(test.side, "m") + " wide, " +
                                           with_unit(contact.thickness, "m") + " thick:",
                                  .lines = {}},
                       .moduli = {.name = "press-moduli", .title = "stiffness against pressing:", .lines = {}}};
    TestSeries series(what, options.pressed.size());
    for (const std::size_t particles : options.pressed) {
        test.particles = particles;
        const auto [measured, time_s] = series.run([&] { return measure_press(test, kPressDepths); });
        PressMeasured all = measured.front();
        for (const PressMeasured& m : measured) {
            result.forces.lines.push_back({.particles = particles,
                                           .depth = m.depth,
                                           .half_space = half_space_force(contact, m.depth),
                                           .series = layer_series_force(contact, m.depth),
                                           .requested = m.requested,
                                           .measured = m.force,
                                           .substeps = m.substeps,
                                           .at_rest = m.at_rest});
            all.at_rest = all.at_rest && m.at_rest;
        }
        add_line(result.moduli, count_of(particles), static_cast<double>(particles), "Young's modulus pressed", "Pa",
                 material.young_modulus, fitted_modulus(test, measured), all, time_s);
    }
    return result;
}

/// The body itself. `homogeneous`: no region has another material, so that the moduli of the whole are known.
TestTable test_body(const DeformableBody& body, const SolidMaterial& material, bool homogeneous,
                    const Stepping& stepping) {
    TestTable table{.name = "body",
                    .title = "body \"" + body.name + "\", " + count_of(body.particles.size()) +
                             ", by homogeneous stress" +
                             (homogeneous ? ":" : " (regions have other materials, so nothing is requested):"),
                    .lines = {}};
    const BodyTests tests(body, material, {.step = stepping.step, .substeps = stepping.substeps});
    TestSeries series(body.name, 4);
    const auto add = [&](const char* quantity, const char* unit, double requested, double measured,
                         const BodyMeasured& of, double time_s) {
        add_line(table, body.name, static_cast<double>(body.particles.size()), quantity, unit,
                 homogeneous ? std::optional(requested) : std::nullopt, measured, of, time_s);
    };
    const auto [stretched, stretched_s] = series.run([&] { return tests.stretch(); });
    add("Young's modulus stretched", "Pa", material.young_modulus, stretched.modulus, stretched, stretched_s);
    add("Poisson's ratio", "", material.poisson_ratio, stretched.poisson_ratio, stretched, stretched_s);
    const auto [sheared, sheared_s] = series.run([&] { return tests.shear(); });
    add("shear modulus", "Pa", shear_modulus(material), sheared.modulus, sheared, sheared_s);
    const auto [swollen, swollen_s] = series.run([&] { return tests.swell(); });
    add("bulk modulus", "Pa", bulk_modulus(material), swollen.modulus, swollen, swollen_s);
    const auto [bent, bent_s] = series.run([&] { return tests.bend(); });
    add("Young's modulus bent", "Pa", material.young_modulus, bent.modulus, bent, bent_s);
    return table;
}

struct SheetResult {
    TestTable table;
    Drape drape;
};

SheetResult test_sheet(const SheetTest& test, const std::string& name) {
    const SheetMaterial& material = test.material;
    const std::string vertices = std::to_string(test.vertices_per_side);
    const std::string square = "square of " + with_unit(test.side, "") + " m";
    const std::string strip = "strip of " + with_unit(test.strip, "") + " m";
    SheetResult result{.table = {.name = "sheet",
                                 .title = "sheet of " + name + ", " + vertices + " x " + vertices + " vertices:",
                                 .lines = {}},
                       .drape = {}};
    TestSeries series("sheet of " + name, 3);
    const auto add = [&](const std::string& specimen, const char* quantity, const char* unit, double requested,
                         double measured, const SheetMeasured& of, double time_s) {
        add_line(result.table, specimen, static_cast<double>(result.table.lines.size() + 1), quantity, unit, requested,
                 measured, of, time_s);
    };
    const auto [pulled, pulled_s] = series.run([&] { return measure_membrane(test); });
    add(square, "membrane stiffness", "N/m", material.membrane_stiffness, pulled.value, pulled, pulled_s);
    add(square, "Poisson's ratio", "", material.poisson_ratio, pulled.poisson_ratio, pulled, pulled_s);
    add(square, "areal density in kg/m^2", "", material.areal_density, pulled.areal_density, pulled, pulled_s);
    if (material.bending_stiffness > 0.0) {
        const auto [bent, bent_s] = series.run([&] { return measure_sheet_bending(test); });
        add(strip, "bending stiffness", "N m", material.bending_stiffness, bent.value, bent, bent_s);
    }
    result.drape = series.run([&] { return measure_drape(test); }).first;
    return result;
}

/// Prints tables, and writes them if there is a folder. Tables of one name get a number.
class MaterialResults {
  public:
    explicit MaterialResults(const std::string& folder) : folder_(folder) {
        if (!folder.empty()) {
            write_for("--out", [&] { std::filesystem::create_directories(folder_); });
        }
    }

    void add(TestTable table, const char* axis) {
        print_and_write(std::move(table), [&](const TestTable& numbered_table) {
            return write_table(folder_, numbered_table, axis, "measured / requested");
        });
    }

    void add(PressTable table) {
        print_and_write(std::move(table),
                        [&](const PressTable& numbered_table) { return write_table(folder_, numbered_table); });
    }

    void add(const Drape& drape) {
        std::cout << "drape of a disc of 0.3 m over a support of 0.18 m (Cusick 1965):\n  coefficient "
                  << with_unit(100.0 * drape.coefficient, "") << " %, " << drape.folds << " folds"
                  << (drape.at_rest ? "" : " (still moving)") << "\n\n";
        if (!folder_.empty()) {
            write_for("--out", [&] { write_mesh(folder_ / (numbered("drape") + ".obj"), drape.mesh); });
        }
    }

  private:
    /// `write` returns why there is no plot, if there is none.
    template <class Table, class Write>
    void print_and_write(Table table, const Write& write) {
        print(std::cout, table);
        std::cout << std::flush;
        if (folder_.empty()) {
            return;
        }
        table.name = numbered(table.name);
        write_for("--out", [&] {
            if (const std::string problem = write(table); !problem.empty()) {
                std::cerr << table.name << ".svg: not drawn: " << problem << '\n';
            }
        });
    }

    std::string numbered(const std::string& name) {
        const auto before = std::count(names_.begin(), names_.end(), name);
        names_.push_back(name);
        return before == 0 ? name : name + '-' + std::to_string(before + 1);
    }

    std::filesystem::path folder_;
    std::vector<std::string> names_;
};

void test_solid(const SolidMaterial& material, const std::string& name, const MaterialOptions& options,
                const Stepping& stepping, MaterialResults& results) {
    results.add(test_bars(material, name, options, stepping), "particles");
    results.add(test_steps(material, name, options.particles.front()), "step, ms");
    PressResult pressed = test_press(material, name, options, stepping);
    results.add(std::move(pressed.forces));
    results.add(std::move(pressed.moduli), "particles");
}

void test_sheet(const SheetTest& test, const std::string& name, MaterialResults& results) {
    SheetResult result = test_sheet(test, name);
    results.add(std::move(result.table), "row of the table");
    results.add(result.drape);
}

bool is_named(const std::string& what) {
    const auto materials = named_materials();
    return std::any_of(materials.begin(), materials.end(), [&](const NamedMaterial& m) { return m.name == what; });
}

/// "; did you mean X?", or nothing. X: a material, scene or generator.
std::string guess_of(const std::string& what) {
    std::vector<std::string> known = material_names();
    for (const BuiltInScene& scene : built_in_scenes()) {
        known.emplace_back(scene.name);
    }
    for (const GeneratorEntry& entry : generator_table()) {
        known.emplace_back(entry.name);
    }
    return detail::guess(what, known);
}

/// A scene, or one of the body alone. Throws ConfigError that also says where materials are listed.
Config config_of(const std::string& what) {
    if (is_body(what)) {
        return config_of_body(what);
    }
    try {
        return open_scene(what);
    } catch (const ConfigError& error) {
        throw ConfigError(std::string(error.what()) + "; `host-sim materials` lists the named materials" +
                          guess_of(what));
    }
}

/// The test of a sheet of the body's own cells if the body is a square of cells, else of the same as any material's.
SheetTest sheet_test_of(const ModelSettings& model, const SheetMaterial& material, const Stepping& stepping) {
    SheetTest test{.material = material, .step = stepping.step, .substeps = stepping.substeps};
    const bool is_square = model.generator == Generator::Cloth || model.generator == Generator::Curtain;
    if (is_square && model.file.empty() && model.particles.empty() &&
        model.cloth.vertices_per_side >= SheetTest::kFewestPerSide) {
        test.vertices_per_side = model.cloth.vertices_per_side;
        test.side = model.cloth.side;
    }
    return test;
}

void test_model(const ModelSettings& model, const MaterialSettings& given, const MaterialOptions& options,
                const Stepping& stepping, MaterialResults& results) {
    const DeformableBody body = with_progress_bar("building " + options.what,
                                                  [&](const Progress& progress) { return make_body(model, progress); });
    const std::string name = given.name.empty() ? "\"" + body.name + '"' : given.name;
    if (!body.mesh.closed) {
        test_sheet(sheet_test_of(model, sheet_of(given, {}), stepping), name, results);
        return;
    }
    const SolidMaterial material = solid_of(given, {});
    const bool homogeneous = std::none_of(model.regions.begin(), model.regions.end(),
                                          [](const Region& r) { return r.material.has_value(); });
    results.add(test_body(body, material, homogeneous, stepping), "particles");
    test_solid(material, name, options, stepping, results);
}

int run_material(const MaterialOptions& options) {
    if (is_named(options.what)) {
        if (!options.assignments.empty()) {
            throw CLI::ValidationError("--set", "applies to a scene, and \"" + options.what + "\" is a material");
        }
        MaterialResults results(options.out);
        const NamedMaterial& material = find_material(options.what);
        if (material.kind == MaterialKind::Solid) {
            test_solid(material.solid, options.what, options, {}, results);
        } else {
            test_sheet({.material = material.sheet}, options.what, results);
        }
        return kExitDone;
    }
    const Scene scene = load_scene(config_of(options.what), scene_name(options.what), options.assignments);
    std::vector<ModelSettings> models = scene.objects;
    models.insert(models.begin(), scene.model);
    MaterialResults results(options.out);
    bool any = false;
    for (const ModelSettings& model : models) {
        if (model.material) {
            test_model(model, *model.material, options, {scene.solver.step, scene.solver.substeps}, results);
            any = true;
        }
    }
    if (!any) {
        throw std::runtime_error(options.what + ": no body has a material" +
                                 (is_rigid(scene.model) ? ", and plates and rods are rigid"
                                                        : "; give one with model.material, for example --set "
                                                          "'model.material=\"liver\"'"));
    }
    return kExitDone;
}

}  // namespace

Command add_material_command(CLI::App& app) {
    const auto options = std::make_shared<MaterialOptions>();
    app.footer(
        "Solids: bars that are pulled, bent and twisted, a layer into which a sphere is pressed, and the bodies of a "
        "scene under homogeneous stress. Sheets: a square that is pulled, a strip that sags, and the drape test. All "
        "by the solver that scenes use. Exit status "
        "0 if the tests ran, whatever they found, 1 with the problem if not.");
    app.add_option("what", options->what,
                   "Named material (list: host-sim materials), built-in scene, scene file NAME.toml, generator (" +
                       generator_names() + "), or mesh file")
        ->required();
    app.add_option("--set", options->assignments, "Override a scene key, e.g. model.particles_count=300; repeatable")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    app.add_option("--particles", options->particles, "Particles of the bars, e.g. 120,250,500")
        ->delimiter(',')
        ->check(number_in(kFewestParticles, kMostParticles))
        ->capture_default_str();
    app.add_option("--press-particles", options->pressed, "Particles of the pressed layers, e.g. 300,1000,3000")
        ->delimiter(',')
        ->check(number_in(kFewestPressed, kMostPressed))
        ->capture_default_str();
    app.add_option("--out", options->out, "Folder for the tables as CSV, plots, and the draped disc as OBJ")
        ->check(result_folder());
    return [options] { return run_material(*options); };
}

}  // namespace haptic::sim
