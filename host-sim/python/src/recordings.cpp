// haptic.load_recording: CSV files of both processes as arrays.

#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <filesystem>
#include <span>
#include <string>

#include "arrays.hpp"
#include "bindings.hpp"
#include "haptic/csv.hpp"

namespace haptic::python {
namespace {

py::object load_recording(const std::filesystem::path& file) {
    const CsvTable table = [&] {
        const py::gil_scoped_release unlocked;
        return CsvTable::load(file);
    }();
    py::list fields;
    for (const std::string& name : table.columns()) {
        fields.append(py::make_tuple(name, "f8"));
    }
    const py::module_ numpy = py::module_::import("numpy");
    py::object records = numpy.attr("recarray")(table.rows(), numpy.attr("dtype")(fields));
    for (const std::string& name : table.columns()) {
        const std::span<const double> column = table.column(name);
        records[py::str(name)] = py::array_t<double>(static_cast<py::ssize_t>(column.size()), column.data());
    }
    return records;
}

}  // namespace

void bind_recordings(py::module_& module) {
    module.def("load_recording", &load_recording, py::arg("file"),
               R"(Loads a recording of host-sim or rt-core, or any CSV file of numbers with a header.

Returns one record per row. Fields are named as the columns, with the unit at the end: recording.time_s.
Raises RecordingError with file and line.)");
}

}  // namespace haptic::python
