// The module haptic._core. haptic/_core.pyi has its types, for editors and type checkers.

#include <pybind11/pybind11.h>

#include "bindings.hpp"
#include "haptic/config.hpp"
#include "haptic/csv.hpp"
#include "haptic/ring.hpp"

namespace haptic::python {

PYBIND11_MODULE(_core, module) {
    module.doc() = "Simulation, session, queries and materials of the haptic system.";
    module.attr("__version__") = HAPTIC_VERSION;
    // Errors of the libraries. Others are those of Python: std::invalid_argument is ValueError, std::runtime_error is
    // RuntimeError.
    pybind11::register_exception<ConfigError>(module, "SceneError", PyExc_ValueError);
    pybind11::register_exception<CsvError>(module, "RecordingError", PyExc_ValueError);
    pybind11::register_exception<RingError>(module, "SessionError", PyExc_OSError);
    bind_session(module);
    bind_simulation(module);
    bind_triangle_queries(module);
    bind_materials(module);
    bind_recordings(module);
}

}  // namespace haptic::python
