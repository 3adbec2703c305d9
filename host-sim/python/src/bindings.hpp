// Bindings: the parts of the module haptic._core.
#pragma once

#include <pybind11/pybind11.h>

namespace haptic::python {

void bind_simulation(pybind11::module_& module);
void bind_session(pybind11::module_& module);
void bind_triangle_queries(pybind11::module_& module);
void bind_materials(pybind11::module_& module);
void bind_recordings(pybind11::module_& module);

}  // namespace haptic::python
