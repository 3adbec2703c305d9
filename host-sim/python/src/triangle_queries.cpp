// haptic.ccd: sphere-triangle queries over arrays.

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "contact/triangle_query.hpp"

namespace haptic::python {

/// One answer, as a record of numpy.
struct TriangleAnswerRow {
    std::uint8_t touched = 0;  // sim::Feature
    double touch_time = 0.0;
    double passage_time = 0.0;
    double normal[3]{};
    double secure_position[3]{};
};

namespace {

Vec3 point_at(const double* x) {
    return {x[0], x[1], x[2]};
}

sim::TriangleCorners corners_at(const double* x) {
    return {point_at(x), point_at(x + 3), point_at(x + 6)};
}

void require_finite(const Numbers& numbers, const std::string& argument) {
    for (py::ssize_t k = 0; k < numbers.size(); ++k) {
        if (!std::isfinite(numbers.data()[k])) {
            throw py::value_error(argument + " has a number that is not finite, at index " + std::to_string(k) +
                                  " of its values");
        }
    }
}

TriangleAnswerRow row_of(const sim::TriangleAnswer& answer) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    const bool touches = answer.touched != sim::Feature::None;
    TriangleAnswerRow row;
    row.touched = static_cast<std::uint8_t>(answer.touched);
    row.touch_time = touches ? answer.touch_time : nan;
    row.passage_time = answer.passage_time.value_or(nan);
    const Vec3 normal = touches ? answer.normal : Vec3(nan);
    for (int k = 0; k < 3; ++k) {
        row.normal[k] = normal[k];
        row.secure_position[k] = answer.secure_position[k];
    }
    return row;
}

py::object ccd(const Numbers& centers, const Numbers& radii, const Numbers& start, const Numbers& end) {
    require_shape(centers, "centers", {-1, 3});
    const py::ssize_t n = centers.shape(0);
    require_shape(start, "start", {n, 3, 3});
    require_shape(end, "end", {n, 3, 3});
    const bool one_radius = radii.ndim() == 0;
    if (!one_radius) {
        require_shape(radii, "radii", {n});
    }
    require_finite(centers, "centers");
    require_finite(start, "start");
    require_finite(end, "end");
    require_finite(radii, "radii");
    for (py::ssize_t k = 0; k < radii.size(); ++k) {
        if (!(radii.data()[k] > 0.0)) {
            throw py::value_error("radii must be greater than 0, found " + std::to_string(radii.data()[k]) +
                                  " at index " + std::to_string(k));
        }
    }
    const double* const c = centers.data();
    const double* const r = radii.data();
    const double* const a = start.data();
    const double* const b = end.data();
    std::vector<TriangleAnswerRow> rows(static_cast<std::size_t>(n));
    {
        const py::gil_scoped_release unlocked;
        for (py::ssize_t k = 0; k < n; ++k) {
            rows[static_cast<std::size_t>(k)] =
                row_of(sim::answer({.center = point_at(c + 3 * k),
                                    .radius = one_radius ? *r : r[k],
                                    .triangle = {.start = corners_at(a + 9 * k), .end = corners_at(b + 9 * k)}}));
        }
    }
    return records_of(rows);
}

}  // namespace

void bind_triangle_queries(py::module_& module) {
    PYBIND11_NUMPY_DTYPE(TriangleAnswerRow, touched, touch_time, passage_time, normal, secure_position);
    module.def("ccd", &ccd, py::arg("centers"), py::arg("radii"), py::arg("start"), py::arg("end"),
               R"(First contact of spheres at rest with moving triangles (continuous collision detection).

Query k is a sphere and a triangle whose corners move linearly from start[k] at t = 0 to end[k] at t = 1.

centers  (N, 3), m
radii    one number or (N,), m
start    (N, 3, 3), m: the triangles' corners at t = 0
end      (N, 3, 3), m: at t = 1

Returns N records:
  touched          0 none, 1 face, 2 edge, 3 vertex: what the sphere touches first (haptic.FEATURES)
  touch_time       in [0, 1]; nan without contact
  passage_time     in [touch_time, 1], when the triangle passes through the centre; nan if it does not
  normal           unit, from the touched point to the centre
  secure_position  m, where the contact code has the centre at t = 1: never on the other side

The answers are those of `host-sim query ccd`.)");
}

}  // namespace haptic::python
