// Arrays: the simulation's memory as numpy arrays, and arguments that may be any array-like.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <span>
#include <string>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"

namespace haptic::python {

namespace py = pybind11;

/// Read-only numpy array of shape (rows, columns), or (rows,) for `columns` 0, over memory that `owner` keeps.
template <class Value>
[[nodiscard]] py::array view(const Value* first, std::size_t rows, std::size_t columns, const py::handle& owner) {
    std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(rows)};
    if (columns > 0) {
        shape.push_back(static_cast<py::ssize_t>(columns));
    }
    py::array made(py::dtype::of<Value>(), shape, first, owner);
    made.attr("setflags")(py::arg("write") = false);
    return made;
}

[[nodiscard]] inline py::array view(std::span<const Vec3> of, const py::handle& owner) {
    static_assert(sizeof(Vec3) == 3 * sizeof(double));
    return view(of.empty() ? nullptr : &of.front().x, of.size(), 3, owner);
}

[[nodiscard]] inline py::array view(std::span<const double> of, const py::handle& owner) {
    return view(of.data(), of.size(), 0, owner);
}

[[nodiscard]] inline py::array view(std::span<const sim::Triangle> of, const py::handle& owner) {
    return view(of.empty() ? nullptr : of.front().data(), of.size(), 3, owner);
}

/// Argument: any array-like of numbers, as an array of doubles without gaps.
using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Throws py::value_error that names the argument unless it has this shape; -1 stands for any length.
inline void require_shape(const Numbers& given, const std::string& argument, const std::vector<py::ssize_t>& shape) {
    bool fits = given.ndim() == static_cast<py::ssize_t>(shape.size());
    for (std::size_t k = 0; fits && k < shape.size(); ++k) {
        fits = shape[k] < 0 || shape[k] == given.shape(static_cast<py::ssize_t>(k));
    }
    if (fits) {
        return;
    }
    const auto text = [](auto begin, auto end) {
        std::string all;
        for (auto length = begin; length != end; ++length) {
            all += (all.empty() ? "" : ", ") + (*length < 0 ? std::string("N") : std::to_string(*length));
        }
        return "(" + all + ")";
    };
    throw py::value_error(argument + " must have the shape " + text(shape.begin(), shape.end()) + ", found " +
                          text(given.shape(), given.shape() + given.ndim()));
}

/// numpy.record with the fields of a row. Made once, and never released: the interpreter ends before it would be.
template <class Row>
[[nodiscard]] py::handle record_type() {
    static const py::handle type = [] {
        const py::module_ numpy = py::module_::import("numpy");
        return numpy.attr("dtype")(py::make_tuple(numpy.attr("record"), py::dtype::of<Row>())).release();
    }();
    return type;
}

template <class Row>
[[nodiscard]] py::array array_of_records(const Row* first, std::size_t count) {
    return {py::reinterpret_borrow<py::dtype>(record_type<Row>()), {static_cast<py::ssize_t>(count)}, first};
}

/// Array of records whose fields are attributes too: `run.force` for `run["force"]`.
template <class Row>
[[nodiscard]] py::object records_of(const std::vector<Row>& rows) {
    return array_of_records(rows.data(), rows.size()).attr("view")(py::module_::import("numpy").attr("recarray"));
}

/// One such record.
template <class Row>
[[nodiscard]] py::object record_of(const Row& row) {
    return array_of_records(&row, 1)[py::int_(0)];
}

}  // namespace haptic::python
