#include "contact_kernels.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <vector>

#include "contact_tools.hpp"

namespace haptic {
namespace {

using contact_tools::Random;

constexpr std::size_t kKernelRows = 61;  // no multiple of a register

void fill(Random& random, ProxyValues& values) {
    for (double& value : values) {
        value = random.normal();
    }
}

ProxyVectors random_vectors(Random& random) {
    ProxyVectors vectors;
    fill(random, vectors.x);
    fill(random, vectors.y);
    fill(random, vectors.z);
    return vectors;
}

/// All results of a table, for the same inputs each time.
std::vector<double> results_of(const ContactKernels& kernels) {
    Random random(1);
    std::vector<double> results;
    const auto keep = [&results](const ProxyValues& values) {
        results.insert(results.end(), values.begin(), values.end());
    };
    const auto keep_vectors = [&keep](const ProxyVectors& vectors) {
        keep(vectors.x);
        keep(vectors.y);
        keep(vectors.z);
    };
    ProxyPlanes planes;
    planes.normal = random_vectors(random);
    fill(random, planes.offset);
    fill(random, planes.velocity);
    planes.offset[5] = ProxyPlanes::kNone;
    ProxyValues force{};
    fill(random, force);
    const PushingPlanes pushing{&planes, force.data()};
    const ProxyVectors a = random_vectors(random);
    const ProxyVectors b = random_vectors(random);
    ProxyValues values{};
    ProxyVectors vectors;
    // Every remainder of the groups of rows.
    std::vector<ProxyValues> rows(13);
    std::vector<const double*> pointers;
    for (ProxyValues& row : rows) {
        fill(random, row);
        pointers.push_back(row.data());
    }
    for (std::size_t count = 0; count <= rows.size(); ++count) {
        kernels.subtract_rows(values.data(), force.data(), pointers.data(), count, kKernelRows);
        keep(values);
    }
    kernels.rotate(rows[0].data(), a, 0.3, b, kKernelRows, vectors);
    keep_vectors(vectors);
    kernels.find_depths(planes, 0.7, a, kKernelRows, values.data());
    keep(values);
    kernels.add_pull(pushing, kKernelRows, values.data(), vectors);
    keep(values);
    keep_vectors(vectors);
    kernels.relative_squares(pushing, 0.2, a, force.data(), kKernelRows, values.data());
    keep(values);
    kernels.add_power(pushing, 1.0, b, kKernelRows, values.data(), vectors);
    keep(values);
    keep_vectors(vectors);
    kernels.cross(a, b, kKernelRows, vectors);
    keep_vectors(vectors);
    return results;
}

TEST(ContactKernels, ReturnTheSameBitsWithEveryInstructionSet) {
    EXPECT_EQ(results_of(widest_contact_kernels()), results_of(kBaselineContactKernels));
}

TEST(ContactKernels, SubtractEveryRow) {
    const std::vector<double> row = {1.0, 2.0, 4.0};
    const std::vector<const double*> rows(13, row.data());
    const std::vector<double> factors(13, 0.5);
    for (std::size_t count = 0; count <= rows.size(); ++count) {
        std::vector<double> y = {0.0, 0.0, 1.0};
        widest_contact_kernels().subtract_rows(y.data(), factors.data(), rows.data(), count, y.size());
        const double sum = 0.5 * static_cast<double>(count);
        EXPECT_EQ(y, (std::vector{0.0 - sum, 0.0 - 2.0 * sum, 1.0 - 4.0 * sum}));
    }
}

}  // namespace
}  // namespace haptic
