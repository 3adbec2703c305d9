// haptic.Simulation: a scene, its steps without the interpreter's lock, and its state as arrays.

#include "haptic/sim/simulation.hpp"

#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "haptic/clock.hpp"
#include "haptic/config.hpp"
#include "haptic/frames.hpp"
#include "haptic/numeric.hpp"
#include "haptic/setting.hpp"
#include "haptic/sim/scene.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::python {

/// One step, as a record of numpy. The fields are those of sim::StepResult, and its stages' times.
struct StepRow {
    double time = 0.0;
    double step = 0.0;
    double device_position[3]{};
    double device_orientation[4]{};
    double proxy[3]{};
    double proxy_orientation[4]{};
    double hip[3]{};
    double hip_orientation[4]{};
    double force[3]{};
    double torque[3]{};
    double hand_force[3]{};
    double hand_torque[3]{};
    double curl = 0.0;
    double depth = 0.0;
    double equilibrium_error = 0.0;
    std::uint32_t collided = 0;
    std::uint32_t crossings = 0;
    std::uint32_t sheet_crossings = 0;
    std::uint32_t solid_crossings = 0;
    std::uint32_t other_crossings = 0;
    std::uint32_t below_ground = 0;
    double ground_depth = 0.0;
    bool in_contact = false;
    bool overconstrained = false;
    std::int64_t total_ns = 0;
    std::int64_t ccd_ns = 0;
    std::int64_t popout_ns = 0;
    std::int64_t proxy_ns = 0;
    std::int64_t tool_ns = 0;
    std::int64_t collide_ns = 0;
    std::int64_t deform_ns = 0;
    std::int64_t skin_ns = 0;
};

/// A sphere of the tool, as a record of numpy.
struct ProxyRow {
    double radius = 0.0;
    double position[3]{};
    double goal[3]{};
    double force[3]{};
    bool in_contact = false;
    bool sticks = false;
};

/// A plane that a sphere of the tool touches, as a record of numpy.
struct ContactPlaneRow {
    std::uint32_t proxy = 0;
    std::uint32_t body = 0;
    std::uint32_t triangle = 0;
    double normal[3]{};
    double offset = 0.0;
    double velocity = 0.0;
    double force = 0.0;
};

namespace {

constexpr std::int64_t kLookForSignalsNs = 50'000'000;

/// TOML text of a setting's value. Throws py::type_error that names the key.
std::string toml_of(const std::string& key, const py::handle& value) {
    // Arrays and numbers of numpy become Python's.
    if (py::hasattr(value, "tolist")) {
        return toml_of(key, py::object(value.attr("tolist")()));
    }
    if (py::isinstance<py::bool_>(value)) {
        return toml_value(value.cast<bool>());
    }
    if (py::isinstance<py::int_>(value)) {
        return toml_value(value.cast<std::int64_t>());
    }
    if (py::isinstance<py::float_>(value)) {
        return toml_value(value.cast<double>());
    }
    if (py::isinstance<py::str>(value)) {
        return toml_value(value.cast<std::string>());
    }
    if (!py::isinstance<py::sequence>(value)) {
        throw py::type_error("setting " + key + " must be a number, a text, true or false, or a list of them, found " +
                             std::string(py::str(py::type::of(value))));
    }
    std::string all;
    for (const py::handle element : value) {
        all += (all.empty() ? "" : ", ") + toml_of(key, element);
    }
    return "[" + all + "]";
}

/// Opens a scene with some of its settings replaced. Notices on old keys become Python's warnings.
sim::Scene open(const std::string& which, const py::dict& settings) {
    Config config = sim::open_scene(which);
    for (const auto& [key, value] : settings) {
        const auto name = key.cast<std::string>();
        config.set(name + "=" + toml_of(name, value));
    }
    sim::Scene scene = sim::read_scene(config, sim::scene_name(which));
    for (const std::string& notice : scene.notices) {
        py::module_::import("warnings").attr("warn")(notice, py::arg("stacklevel") = 2);
    }
    return scene;
}

StepRow row_of(const sim::StepInput& input, const sim::StepResult& result) {
    StepRow row;
    row.time = result.time;
    row.step = result.step;
    store(input.device.position, row.device_position);
    store(input.device.orientation, row.device_orientation);
    store(result.proxy, row.proxy);
    store(result.proxy_orientation, row.proxy_orientation);
    store(result.hip, row.hip);
    store(result.hip_orientation, row.hip_orientation);
    store(result.force, row.force);
    store(result.torque, row.torque);
    store(result.hand_force, row.hand_force);
    store(result.hand_torque, row.hand_torque);
    row.curl = result.curl;
    row.depth = result.depth;
    row.equilibrium_error = result.equilibrium_error;
    row.collided = static_cast<std::uint32_t>(result.collided);
    row.crossings = static_cast<std::uint32_t>(result.crossings);
    row.sheet_crossings = static_cast<std::uint32_t>(result.surfaces.sheets);
    row.solid_crossings = static_cast<std::uint32_t>(result.surfaces.solids);
    row.other_crossings = static_cast<std::uint32_t>(result.surfaces.others);
    row.below_ground = static_cast<std::uint32_t>(result.surfaces.below_ground);
    row.ground_depth = result.surfaces.ground_depth;
    row.in_contact = result.in_contact;
    row.overconstrained = result.overconstrained;
    row.total_ns = result.times.total_ns;
    row.ccd_ns = result.times.ccd_ns;
    row.popout_ns = result.times.popout_ns;
    row.proxy_ns = result.times.proxy_ns;
    row.tool_ns = result.times.tool_ns;
    row.collide_ns = result.times.collide_ns;
    row.deform_ns = result.times.deform_ns;
    row.skin_ns = result.times.skin_ns;
    return row;
}

Quat unit_quaternion(const double* wxyz, const std::string& argument) {
    const Quat q(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
    const double length = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    if (!(std::abs(length - 1.0) <= kUnitTolerance)) {
        throw py::value_error(argument + " must be a unit quaternion (w, x, y, z); its length is " +
                              std::to_string(length));
    }
    return Quat(q.w / length, q.x / length, q.y / length, q.z / length);
}

Vec3 finite_point(const double* xyz, const std::string& argument) {
    const Vec3 point(xyz[0], xyz[1], xyz[2]);
    if (!is_finite(point)) {
        throw py::value_error(argument + " must be finite");
    }
    return point;
}

double closure(double curl) {
    if (!(curl >= 0.0 && curl <= 1.0)) {
        throw py::value_error("curl must be 0 (open) to 1 (closed), found " + std::to_string(curl));
    }
    return curl;
}

/// A simulation and the time of its script. One thread at a time may step it.
class PythonSimulation {
  public:
    PythonSimulation(const sim::Scene& scene, bool verify, const sim::Progress& progress)
        : simulation_(scene, &monotonic_now_ns, progress) {
        simulation_.set_verification(verify);
    }

    /// Holds the simulation for one thread. Throws std::runtime_error if another one has it.
    class Turn {
      public:
        explicit Turn(PythonSimulation& of) : stepping_(of.stepping_) {
            if (stepping_.test_and_set()) {
                throw std::runtime_error("another thread steps this simulation; make one for each thread");
            }
        }
        Turn(const Turn&) = delete;
        Turn& operator=(const Turn&) = delete;
        ~Turn() { stepping_.clear(); }

      private:
        std::atomic_flag& stepping_;
    };

    [[nodiscard]] sim::Simulation& simulation() noexcept { return simulation_; }
    [[nodiscard]] const sim::Simulation& simulation() const noexcept { return simulation_; }

    [[nodiscard]] sim::StepInput script() const { return simulation_.scripted_input(time_ns_); }
    [[nodiscard]] std::int64_t time_ns() const noexcept { return time_ns_; }

    StepRow step(const sim::StepInput& input) {
        const sim::StepResult result = simulation_.step(input);
        time_ns_ += nanoseconds(result.step);
        return row_of(input, result);
    }

    /// Steps with the inputs that `input_of` makes, without the interpreter's lock. An interrupt ends it with an
    /// exception.
    template <class InputOf>
    py::object run(std::size_t steps, const InputOf& input_of) {
        const Turn turn(*this);
        std::vector<StepRow> rows;
        rows.reserve(steps);
        {
            const py::gil_scoped_release unlocked;
            std::int64_t looked_ns = monotonic_now_ns();
            for (std::size_t k = 0; k < steps; ++k) {
                rows.push_back(step(input_of(k)));
                if (const std::int64_t now_ns = monotonic_now_ns(); now_ns - looked_ns > kLookForSignalsNs) {
                    looked_ns = now_ns;
                    const py::gil_scoped_acquire locked;
                    if (PyErr_CheckSignals() != 0) {
                        throw py::error_already_set();
                    }
                }
            }
        }
        return records_of(rows);
    }

  private:
    sim::Simulation simulation_;
    std::int64_t time_ns_ = 0;  // since the start
    std::atomic_flag stepping_ = ATOMIC_FLAG_INIT;
};

std::unique_ptr<PythonSimulation> make(const std::string& scene, const py::dict& settings, bool verify,
                                       const sim::Progress& progress) {
    const sim::Scene opened = open(scene, settings);
    // A callable of Python takes the lock itself, for as long as it is called.
    const py::gil_scoped_release unlocked;
    return std::make_unique<PythonSimulation>(opened, verify, progress);
}

/// One step, as the record that run() returns for it.
py::object step_once(PythonSimulation& of, const sim::StepInput& input) {
    const PythonSimulation::Turn turn(of);
    const StepRow row = [&] {
        const py::gil_scoped_release unlocked;
        return of.step(input);
    }();
    return record_of(row);
}

py::object step(PythonSimulation& of, const std::optional<Numbers>& position, const std::optional<Numbers>& orientation,
                std::optional<double> curl, std::uint32_t buttons) {
    if (!position) {
        if (orientation || curl || buttons != 0) {
            throw py::type_error("step: orientation, curl and buttons need a position");
        }
        return step_once(of, of.script());
    }
    require_shape(*position, "position", {3});
    sim::StepInput input;
    input.time_ns = of.time_ns();
    input.device.position = finite_point(position->data(), "position");
    if (orientation) {
        require_shape(*orientation, "orientation", {4});
        input.device.orientation = unit_quaternion(orientation->data(), "orientation");
    }
    if (curl) {
        input.curl = closure(*curl);
    }
    input.buttons = buttons;
    return step_once(of, input);
}

py::object step_state(PythonSimulation& of, const py::array_t<DeviceState, py::array::c_style>& state,
                      std::int64_t time_ns) {
    if (state.size() != 1) {
        throw py::value_error("step_state: one device state is needed, found " + std::to_string(state.size()));
    }
    const DeviceState& s = *state.data();
    (void)finite_point(s.position, "position of the device state");
    (void)unit_quaternion(s.orientation, "orientation of the device state");
    return step_once(of, sim::input_from(s, time_ns));
}

py::object run(PythonSimulation& of, std::optional<std::size_t> steps, std::optional<double> duration) {
    if (steps && duration) {
        throw py::type_error("run: steps and duration exclude each other");
    }
    const sim::Scene& scene = of.simulation().scene();
    const double seconds_to_run = duration.value_or(scene.duration_s);
    if (!(seconds_to_run >= 0.0 && seconds_to_run <= 1e6)) {
        throw py::value_error("duration must be 0 to 1e6 s, found " + std::to_string(seconds_to_run));
    }
    const std::size_t count =
        steps.value_or(static_cast<std::size_t>(std::llround(seconds_to_run / scene.solver.step)));
    return of.run(count, [&](std::size_t) { return of.script(); });
}

py::object follow(PythonSimulation& of, const Numbers& poses, const std::optional<Numbers>& curl,
                  const std::optional<py::array_t<std::uint32_t, py::array::c_style | py::array::forcecast>>& buttons) {
    const bool positions = poses.ndim() == 2 && poses.shape(1) == 3;
    if (!positions) {
        require_shape(poses, "poses", {-1, 7});
    }
    const py::ssize_t count = poses.shape(0);
    if (curl) {
        require_shape(*curl, "curl", {count});
    }
    if (buttons && (buttons->ndim() != 1 || buttons->shape(0) != count)) {
        throw py::value_error("buttons must have the shape (" + std::to_string(count) + ")");
    }
    std::vector<sim::StepInput> inputs(static_cast<std::size_t>(count));
    for (std::size_t k = 0; k < inputs.size(); ++k) {
        const double* const row = poses.data() + k * static_cast<std::size_t>(poses.shape(1));
        inputs[k].device.position = finite_point(row, "row " + std::to_string(k) + " of poses");
        if (!positions) {
            inputs[k].device.orientation =
                unit_quaternion(row + 3, "rotation in row " + std::to_string(k) + " of poses");
        }
        if (curl) {
            inputs[k].curl = closure(curl->data()[k]);
        }
        inputs[k].buttons = buttons ? buttons->data()[k] : 0u;
    }
    return of.run(inputs.size(), [&](std::size_t k) {
        inputs[k].time_ns = of.time_ns();
        return inputs[k];
    });
}

py::object proxies_of(const PythonSimulation& of) {
    std::vector<ProxyRow> rows;
    const sim::ToolProxies& tool = of.simulation().tool();
    for (std::size_t i = 0; i < tool.particles().size(); ++i) {
        const sim::ToolProxy& proxy = tool.particles()[i];
        ProxyRow& row = rows.emplace_back();
        row.radius = proxy.radius;
        store(proxy.position, row.position);
        store(proxy.goal, row.goal);
        store(tool.force_on(i), row.force);
        row.in_contact = proxy.in_contact();
        row.sticks = proxy.sticks();
    }
    return records_of(rows);
}

py::object contacts_of(const PythonSimulation& of) {
    std::vector<ContactPlaneRow> rows;
    for (const sim::SurfaceForce& surface : of.simulation().surface_forces()) {
        if (surface.touches || surface.force > 0.0) {
            ContactPlaneRow& row = rows.emplace_back();
            row.proxy = surface.proxy;
            row.body = surface.plane.touched.object;
            row.triangle = surface.plane.touched.triangle;
            store(surface.plane.normal, row.normal);
            row.offset = surface.plane.offset;
            row.velocity = surface.plane.velocity;
            row.force = surface.force;
        }
    }
    return records_of(rows);
}

/// The live setting of a key. Throws py::key_error that lists them.
const sim::LiveSetting& live_setting(const std::string& key) {
    std::string keys;
    for (const sim::LiveSetting& setting : sim::live_setting_list()) {
        if (setting.key == key) {
            return setting;
        }
        keys += (keys.empty() ? "" : ", ") + std::string(setting.key);
    }
    throw py::key_error(key + " cannot change while the scene runs; these can: " + keys);
}

const std::vector<std::string>& choices_of(const sim::LiveSetting& setting) {
    return find_setting(sim::scene_reference(), setting.key).type.choices;
}

/// The number that stands for a value: itself, or the index of a choice.
double number_of(const sim::LiveSetting& setting, const py::handle& value) {
    const std::vector<std::string>& choices = choices_of(setting);
    if (choices.empty()) {
        return value.cast<double>();
    }
    std::string known;
    for (std::size_t k = 0; k < choices.size(); ++k) {
        if (py::isinstance<py::str>(value) && choices[k] == value.cast<std::string>()) {
            return static_cast<double>(k);
        }
        known += (known.empty() ? "" : ", ") + choices[k];
    }
    throw py::value_error(std::string(setting.key) + " must be one of " + known);
}

py::dict settings_of(const PythonSimulation& of) {
    py::dict all;
    for (const sim::LiveSetting& setting : sim::live_setting_list()) {
        const double value = setting.get(of.simulation().settings());
        const std::vector<std::string>& choices = choices_of(setting);
        if (choices.empty()) {
            all[py::str(std::string(setting.key))] = value;
        } else {
            all[py::str(std::string(setting.key))] = choices.at(static_cast<std::size_t>(value));
        }
    }
    return all;
}

void change_settings(PythonSimulation& of, const py::dict& changes) {
    const PythonSimulation::Turn turn(of);
    sim::LiveSettings settings = of.simulation().settings();
    for (const auto& [key, value] : changes) {
        const sim::LiveSetting& setting = live_setting(key.cast<std::string>());
        setting.set(settings, number_of(setting, value));
    }
    of.simulation().change_settings(settings);
}

/// One body of a simulation: its names in the common arrays.
struct PythonBody {
    py::object simulation;  // keeps the body
    const sim::SceneBody* body;
    std::size_t particles = 0;
};

py::slice range(std::size_t first, std::size_t count) {
    return {static_cast<py::ssize_t>(first), static_cast<py::ssize_t>(first + count), 1};
}

std::vector<PythonBody> bodies_of(const py::object& self) {
    const sim::Simulation& simulation = self.cast<const PythonSimulation&>().simulation();
    const std::vector<sim::SceneBody>& bodies = simulation.bodies();
    std::vector<PythonBody> all;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        const std::size_t end = b + 1 < bodies.size() ? bodies[b + 1].first_particle : simulation.model().size();
        all.push_back({.simulation = self, .body = &bodies[b], .particles = end - bodies[b].first_particle});
    }
    return all;
}

/// Particles of all bodies, as arrays.
struct PythonParticles {
    py::object simulation;  // keeps them
    const sim::ParticleModel* model;
};

void bind_bodies(py::module_& module) {
    py::class_<PythonBody>(module, "Body", "One body of a simulation.")
        .def_property_readonly("name", [](const PythonBody& b) { return b.body->name; })
        .def_property_readonly(
            "vertices", [](const PythonBody& b) { return range(b.body->first_vertex, b.body->mesh.vertices.size()); },
            "slice of its vertices in Simulation.vertices")
        .def_property_readonly(
            "particles", [](const PythonBody& b) { return range(b.body->first_particle, b.particles); },
            "slice of its particles in Simulation.particles")
        .def_property_readonly(
            "triangles", [](const PythonBody& b) { return view(b.body->mesh.triangles, b.simulation); },
            "(T, 3), indices of its own vertices, counter-clockwise seen from outside; read-only")
        .def_property_readonly(
            "rest_vertices", [](const PythonBody& b) { return view(b.body->mesh.vertices, b.simulation); },
            "(V, 3), m, at rest; read-only")
        .def_property_readonly(
            "closed", [](const PythonBody& b) { return b.body->mesh.closed; }, "whether it encloses a volume");

    py::class_<PythonParticles>(module, "Particles",
                                "Particles of all bodies. Arrays are read-only views of the simulation's memory: they "
                                "follow its steps.")
        .def("__len__", [](const PythonParticles& p) { return p.model->size(); })
        .def_property_readonly(
            "position", [](const PythonParticles& p) { return view(p.model->position, p.simulation); }, "(N, 3), m")
        .def_property_readonly(
            "velocity", [](const PythonParticles& p) { return view(p.model->velocity, p.simulation); }, "(N, 3), m/s")
        .def_property_readonly(
            "angular_velocity", [](const PythonParticles& p) { return view(p.model->angular_velocity, p.simulation); },
            "(N, 3), rad/s")
        .def_property_readonly(
            "rest_position", [](const PythonParticles& p) { return view(p.model->rest_position, p.simulation); },
            "(N, 3), m")
        .def_property_readonly(
            "mass", [](const PythonParticles& p) { return view(p.model->mass, p.simulation); }, "(N,), kg")
        .def_property_readonly(
            "orientation",
            [](const PythonParticles& p) {
                py::array_t<double> all({static_cast<py::ssize_t>(p.model->size()), py::ssize_t{4}});
                auto wxyz = all.mutable_unchecked<2>();
                for (py::ssize_t i = 0; i < all.shape(0); ++i) {
                    const Quat& q = p.model->orientation[static_cast<std::size_t>(i)];
                    wxyz(i, 0) = q.w;
                    wxyz(i, 1) = q.x;
                    wxyz(i, 2) = q.y;
                    wxyz(i, 3) = q.z;
                }
                return all;
            },
            "(N, 4), (w, x, y, z), present_from_rest; a copy");
}

}  // namespace

void bind_simulation(py::module_& module) {
    PYBIND11_NUMPY_DTYPE(StepRow, time, step, device_position, device_orientation, proxy, proxy_orientation, hip,
                         hip_orientation, force, torque, hand_force, hand_torque, curl, depth, equilibrium_error,
                         collided, crossings, sheet_crossings, solid_crossings, other_crossings, below_ground,
                         ground_depth, in_contact, overconstrained, total_ns, ccd_ns, popout_ns, proxy_ns, tool_ns,
                         collide_ns, deform_ns, skin_ns);
    PYBIND11_NUMPY_DTYPE(ProxyRow, radius, position, goal, force, in_contact, sticks);
    PYBIND11_NUMPY_DTYPE(ContactPlaneRow, proxy, body, triangle, normal, offset, velocity, force);
    bind_bodies(module);

    module.def(
        "scenes",
        [] {
            py::dict all;
            for (const sim::BuiltInScene& scene : sim::built_in_scenes()) {
                const std::string name(scene.name);
                all[py::str(name)] = sim::read_scene(sim::open_scene(name), name).description;
            }
            return all;
        },
        "The built-in scenes: name and description.");

    py::class_<PythonSimulation>(module, "Simulation",
                                 R"(A scene in motion (host-sim/docs/python.md).

scene     name of a built-in scene (haptic.scenes()), or path of a scene file NAME.toml
settings  replaces keys of the scene: {"solver.step": 0.005, "model.material": "ecoflex 00-30"}
verify    checks in every step, by an independent method, that no proxy passed through a surface, and counts where
          surfaces cross or are below the ground: a step's `crossings`, `sheet_crossings` and so on (see run)
progress  called with the share, 0 to 1, of the bodies that are built

All of SI: m, N, s, rad; right-handed, y up; rotations (w, x, y, z). Steps release the interpreter's lock. One thread at a
time may step a simulation. Raises SceneError.)")
        .def(py::init(&make), py::arg("scene"), py::arg("settings") = py::dict(), py::kw_only(),
             py::arg("verify") = false, py::arg("progress") = py::none())
        .def("step", &step, py::arg("position") = py::none(), py::arg("orientation") = py::none(), py::kw_only(),
             py::arg("curl") = py::none(), py::arg("buttons") = 0,
             R"(Makes one step. Without arguments the hand follows the scene's script.

position     (3,), m, of the grip, device frame
orientation  (4,), (w, x, y, z), device_from_grip
curl         closure of a hand that can close, 0 to 1; otherwise button close_button closes it
buttons      bit k: button k is pressed

Returns the record of the step (see run).)")
        .def("step_state", &step_state, py::arg("state"), py::arg("time_ns"),
             R"(Makes one step with a device state of rt-core (Session.read), for a simulation in real time.

time_ns  CLOCK_MONOTONIC, beginning of the step (haptic.now_ns()))")
        .def("run", &run, py::arg("steps") = py::none(), py::arg("duration") = py::none(),
             R"(Follows the scene's script for a number of steps, or seconds, or as long as the scene says.

Returns one record per step; run.force is the same as run["force"]:
  time, step                      s: beginning of the step, its length
  device_position, _orientation   m, device frame: the grip
  hip, hip_orientation            m, scene: the same, mapped
  proxy, proxy_orientation        m, scene: the tool, which surfaces hold back
  force, torque                   N, N m, scene: on the tool, about the hip
  hand_force, hand_torque         N, N m, device frame: at the hand
  curl, depth                     0..1; m, of a proxy's goal beyond the surface
  in_contact, collided            whether surfaces press on the tool; number of its proxies in contact
  overconstrained                 a proxy has less room than its radius; where it has none, surfaces stand still
  crossings                       proxies that crossed a surface, with verify=True; must be 0
  sheet_crossings, solid_crossings, other_crossings
                                  with verify=True: edges that pierce a triangle: of sheets; of solids, from which they
                                  are kept apart, their own too; others. The first two must be 0
  below_ground, ground_depth      with verify=True: vertices below the ground; m, of the deepest
  equilibrium_error               m
  total_ns, ccd_ns, popout_ns, proxy_ns, tool_ns, collide_ns, deform_ns, skin_ns: time that stages took)")
        .def("follow", &follow, py::arg("poses"), py::kw_only(), py::arg("curl") = py::none(),
             py::arg("buttons") = py::none(),
             R"(Makes one step for each pose of the grip in the device frame.

poses    (N, 3), m, or (N, 7), with the rotation (w, x, y, z)
curl     (N,), 0 to 1
buttons  (N,)

Returns N records (see run).)")
        .def_property_readonly(
            "vertices",
            [](const py::object& self) {
                return view(self.cast<const PythonSimulation&>().simulation().vertices(), self);
            },
            "(V, 3), m, scene: vertices of all bodies. A read-only view of the simulation's memory: it follows the "
            "steps.")
        .def_property_readonly(
            "triangles",
            [](const py::object& self) {
                return view(self.cast<const PythonSimulation&>().simulation().mesh().triangles, self);
            },
            "(T, 3), indices into vertices; read-only view")
        .def_property_readonly(
            "particles",
            [](const py::object& self) {
                return PythonParticles{self, &self.cast<const PythonSimulation&>().simulation().model()};
            },
            "Particles of all bodies.")
        .def_property_readonly("bodies", &bodies_of, "Bodies of the scene, in the order of their vertices.")
        .def_property_readonly("proxies", &proxies_of,
                               "Spheres of the tool after the last step, a copy: radius (m), position and goal (m, "
                               "scene), force (N, scene: of surfaces), in_contact, sticks.")
        .def_property_readonly("contacts", &contacts_of,
                               "Planes that held the tool's spheres back in the last step, a copy: proxy, body and "
                               "triangle (indices), normal (unit, scene), offset (m: dot(normal, centre) >= offset), "
                               "velocity (m/s) and force (N) along the normal, means over the step. Without friction "
                               "the forces add up to that on the tool.")
        .def_property_readonly(
            "frame",
            [](const py::object& self) {
                const ContactFrame& frame = self.cast<const PythonSimulation&>().simulation().frame();
                py::array made(py::dtype::of<ContactFrame>(), std::vector<py::ssize_t>{}, &frame, self);
                made.attr("setflags")(py::arg("write") = false);
                return made;
            },
            "Contact frame of the last step (haptic.CONTACT_FRAME), for Session.publish. A read-only view.")
        .def_property_readonly("settings", &settings_of, "Live settings as last requested.")
        .def("change_settings", &change_settings, py::arg("changes"),
             "Changes live settings from the next step on, without a jump of the force: {\"coupling.stiffness\": 50}.")
        .def_property_readonly(
            "time", [](const PythonSimulation& s) { return s.simulation().time(); },
            "s, since the start: beginning of the next step")
        .def_property_readonly(
            "steps", [](const PythonSimulation& s) { return s.simulation().steps(); }, "steps made")
        .def_property_readonly(
            "substeps", [](const PythonSimulation& s) { return s.simulation().substeps(); },
            "equal parts of a step, unless contacts ask for more")
        .def_property_readonly(
            "state_hash", [](const PythonSimulation& s) { return s.simulation().state_hash(); },
            "hash of all bits of the state, as `host-sim run` prints it")
        .def("__repr__", [](const PythonSimulation& s) {
            const sim::Simulation& of = s.simulation();
            return "<haptic.Simulation " + of.scene().name + ": " + std::to_string(of.vertices().size()) +
                   " vertices, " + std::to_string(of.model().size()) + " particles, t = " + std::to_string(of.time()) +
                   " s>";
        });
}

}  // namespace haptic::python
