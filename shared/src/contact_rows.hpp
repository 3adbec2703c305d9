// Loops of the kernel table (contact_kernels.hpp), for registers of kBytes: the parameter gives each instruction set
// functions of its own. They call no function that another source might share with them.
#pragma once

#include <cstddef>

#include "contact_kernels.hpp"
#include "haptic/realtime.hpp"
#include "rendering/proxy_arrays.hpp"

namespace haptic {

template <std::size_t kBytes>
struct ContactRows {
    /// Coordinates as pointers: g++ 12 does not see through the arrays in each loop.
    struct Coordinates {
        const double* x;
        const double* y;
        const double* z;
        explicit Coordinates(const ProxyVectors& v) HAPTIC_RT : x(v.x.data()), y(v.y.data()), z(v.z.data()) {}
    };

    static void subtract_rows(double* __restrict y, const double* factors, const double* const* rows, std::size_t count,
                              std::size_t length) HAPTIC_RT {
        // Eight rows at a time, in two sums.
        std::size_t k = 0;
        for (; k + 8 <= count; k += 8) {
            const double* const a = factors + k;
            const double a0 = a[0], a1 = a[1], a2 = a[2], a3 = a[3], a4 = a[4], a5 = a[5], a6 = a[6], a7 = a[7];
            const double* const* const x = rows + k;
            const double *x0 = x[0], *x1 = x[1], *x2 = x[2], *x3 = x[3], *x4 = x[4], *x5 = x[5], *x6 = x[6], *x7 = x[7];
            for (std::size_t i = 0; i < length; ++i) {
                y[i] = (y[i] - ((a0 * x0[i] + a1 * x1[i]) + (a2 * x2[i] + a3 * x3[i]))) -
                       ((a4 * x4[i] + a5 * x5[i]) + (a6 * x6[i] + a7 * x7[i]));
            }
        }
        for (; k + 4 <= count; k += 4) {
            const double* const a = factors + k;
            const double a0 = a[0], a1 = a[1], a2 = a[2], a3 = a[3];
            const double *x0 = rows[k], *x1 = rows[k + 1], *x2 = rows[k + 2], *x3 = rows[k + 3];
            for (std::size_t i = 0; i < length; ++i) {
                y[i] -= (a0 * x0[i] + a1 * x1[i]) + (a2 * x2[i] + a3 * x3[i]);
            }
        }
        for (; k < count; ++k) {
            const double factor = factors[k];
            const double* const x = rows[k];
            for (std::size_t i = 0; i < length; ++i) {
                y[i] -= factor * x[i];
            }
        }
    }

    static void rotate(const double* r, const ProxyVectors& v, double factor, const ProxyVectors& w, std::size_t count,
                       ProxyVectors& __restrict rotated) HAPTIC_RT {
        const double xx = r[0], yx = r[1], zx = r[2], xy = r[3], yy = r[4], zy = r[5], xz = r[6], yz = r[7], zz = r[8];
        double* const to_x = rotated.x.data();
        double* const to_y = rotated.y.data();
        double* const to_z = rotated.z.data();
        const Coordinates from(v);
        const Coordinates added(w);
        for (std::size_t i = 0; i < count; ++i) {
            const double x = from.x[i] + factor * added.x[i];
            const double y = from.y[i] + factor * added.y[i];
            const double z = from.z[i] + factor * added.z[i];
            to_x[i] = xx * x + xy * y + xz * z;
            to_y[i] = yx * x + yy * y + yz * z;
            to_z[i] = zx * x + zy * y + zz * z;
        }
    }

    static void find_depths(const ProxyPlanes& planes, double age_s, const ProxyVectors& position, std::size_t count,
                            double* __restrict depth) HAPTIC_RT {
        const Coordinates n(planes.normal);
        const Coordinates at(position);
        const double* const offset = planes.offset.data();
        const double* const velocity = planes.velocity.data();
        for (std::size_t i = 0; i < count; ++i) {
            depth[i] = (offset[i] + velocity[i] * age_s) - (n.x[i] * at.x[i] + n.y[i] * at.y[i] + n.z[i] * at.z[i]);
        }
    }

    static void add_pull(const PushingPlanes& pushing, std::size_t count, double* __restrict touches,
                         ProxyVectors& __restrict pull) HAPTIC_RT {
        const Coordinates n(pushing.planes->normal);
        const double* const force = pushing.force;
        double* const x = pull.x.data();
        double* const y = pull.y.data();
        double* const z = pull.z.data();
        for (std::size_t i = 0; i < count; ++i) {
            touches[i] = force[i] > 0.0 ? 1.0 : touches[i];
            x[i] += force[i] * n.x[i];
            y[i] += force[i] * n.y[i];
            z[i] += force[i] * n.z[i];
        }
    }

    static void cross(const ProxyVectors& a, const ProxyVectors& b, std::size_t count,
                      ProxyVectors& __restrict product) HAPTIC_RT {
        double* const x = product.x.data();
        double* const y = product.y.data();
        double* const z = product.z.data();
        const Coordinates left(a);
        const Coordinates right(b);
        for (std::size_t i = 0; i < count; ++i) {
            x[i] = left.y[i] * right.z[i] - right.y[i] * left.z[i];
            y[i] = left.z[i] * right.x[i] - right.z[i] * left.x[i];
            z[i] = left.x[i] * right.y[i] - right.x[i] * left.y[i];
        }
    }

    static void add_power(const PushingPlanes& pushing, double announced, const ProxyVectors& rest, std::size_t count,
                          double* __restrict power, ProxyVectors& __restrict velocity) HAPTIC_RT {
        const Coordinates n(pushing.planes->normal);
        const double* const speed = pushing.planes->velocity.data();
        const double* const force = pushing.force;
        double* const x = velocity.x.data();
        double* const y = velocity.y.data();
        double* const z = velocity.z.data();
        const Coordinates at_rest(rest);
        for (std::size_t i = 0; i < count; ++i) {
            const double of_rest = n.x[i] * at_rest.x[i] + n.y[i] * at_rest.y[i] + n.z[i] * at_rest.z[i];
            const double pushed = force[i] * (announced * speed[i] - of_rest);
            power[i] += pushed;
            x[i] += pushed * n.x[i];
            y[i] += pushed * n.y[i];
            z[i] += pushed * n.z[i];
        }
    }

    static void relative_squares(const PushingPlanes& pushing, double elapsed_s, const ProxyVectors& d,
                                 const double* touches, std::size_t count, double* __restrict squares) HAPTIC_RT {
        const Coordinates n(pushing.planes->normal);
        const Coordinates own(d);
        const double* const offset = pushing.planes->offset.data();
        const double* const velocity = pushing.planes->velocity.data();
        const double* const force = pushing.force;
        for (std::size_t i = 0; i < count; ++i) {
            // Relative to this plane, which moves along its normal.
            const double moved = velocity[i] * elapsed_s;
            const double x = own.x[i] - moved * n.x[i];
            const double y = own.y[i] - moved * n.y[i];
            const double z = own.z[i] - moved * n.z[i];
            // Positive where this plane counts.
            const double pushes = force[i];
            const double exists = offset[i] - ProxyPlanes::kNone;
            const double counts = touches[i] > 0.0 ? pushes : exists;
            const double relative = counts > 0.0 ? x * x + y * y + z * z : 0.0;
            squares[i] = squares[i] < relative ? relative : squares[i];
        }
    }

    static constexpr ContactKernels kKernels{subtract_rows, rotate,    find_depths,     add_pull,
                                             cross,         add_power, relative_squares};
};

}  // namespace haptic
