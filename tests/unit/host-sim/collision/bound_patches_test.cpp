// Vertices that are bound because pushes do not help: whatever they are asked, planes keep them apart.
#include "collision/bound_patches.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <vector>

#include "dynamics/rows.hpp"
#include "meeting_surfaces.hpp"

namespace haptic::sim {
namespace {

/// Surfaces of which is bound what comes too near.
class Binding {
  public:
    explicit Binding(std::uint32_t seed, bool one_is_exact = false)
        : surfaces(seed, one_is_exact), patches(surfaces.paths()) {
        surfaces.search();
    }
    /// Of the listed pairs, those that come nearer than the gap.
    [[nodiscard]] std::vector<UnsafePair> unsafe() {
        std::vector<UnsafePair> all;
        surfaces.pairs().for_each_list([&](ListedPairs& list) {
            for (std::size_t k = 0; k < list.size(); ++k) {
                if (surfaces.least_distance(list.kind, list.vertices(k)) < gap()) {
                    all.push_back({&list, k});
                }
            }
        });
        return all;
    }
    /// Binds those, or searches again where bound vertices have gone. False: nothing is unsafe there either.
    [[nodiscard]] bool advance() {
        if (const std::vector<UnsafePair> found = unsafe(); !found.empty()) {
            EXPECT_TRUE(patches.bind(found)) << found.size() << " pairs are unsafe whose vertices are bound";
            EXPECT_FALSE(patches.bind(found)) << "all of them are by now";
        } else if (!surfaces.search_again()) {
            return false;
        }
        patches.move(surfaces.pairs());
        return true;
    }
    /// Pairs of one patch that have come too near all the same, and all of them.
    struct Count {
        std::size_t near = 0;
        std::size_t all = 0;
    };
    [[nodiscard]] Count of_one_patch() {
        Count count;
        surfaces.pairs().for_each_list([&](ListedPairs& list) {
            for (std::size_t k = 0; k < list.size(); ++k) {
                if (patches.is_kept_by_planes(list.vertices(k))) {
                    ++count.all;
                    const double least = surfaces.least_distance(list.kind, list.vertices(k));
                    count.near += least < gap() ? 1U : 0U;
                }
            }
        });
        return count;
    }
    /// m, that is kept, but for rounding.
    [[nodiscard]] double gap() { return 0.999 * surfaces.paths().least_gap; }

    MeetingSurfaces surfaces;
    BoundPatches patches;
};

constexpr int kMostRounds = 30;

TEST(BoundPatches, KeepTheirGapsUntilAllDo) {
    for (std::uint32_t seed = 1; seed <= 3; ++seed) {
        Binding binding(seed);
        int rounds = 0;
        while (rounds < kMostRounds && binding.advance()) {
            ++rounds;
            const Binding::Count count = binding.of_one_patch();
            EXPECT_GT(count.all, 100U);
            EXPECT_EQ(count.near, 0U) << "seed " << seed << ", round " << rounds << ", of " << count.all;
        }
        EXPECT_GT(rounds, 1) << "nothing is in the way";
        EXPECT_LT(rounds, kMostRounds) << "seed " << seed;
        EXPECT_TRUE(binding.surfaces.nearer_than(binding.gap()).empty()) << "seed " << seed;
    }
}

TEST(BoundPatches, LeaveExactSurfacesAsTheyAre) {
    Binding binding(1, true);
    const SurfacePaths& paths = binding.surfaces.paths();
    std::size_t bound = 0;
    for (int round = 0; round < 3 && binding.advance(); ++round) {
        for (std::uint32_t v = 0; v < paths.surface_of.size(); ++v) {
            if (paths.is_exact(v) && paths.parent[v] != SurfacePaths::kFree) {
                ++bound;
                EXPECT_EQ(vector_of(paths.end[v]), vector_of(paths.asked[v])) << v;
            }
        }
    }
    EXPECT_GT(bound, 10U);
}

TEST(BoundPatches, BeginAnAttemptFree) {
    Binding binding(2);
    ASSERT_TRUE(binding.advance());
    binding.patches.begin_attempt();
    binding.surfaces.search();
    for (const std::uint32_t parent : binding.surfaces.paths().parent) {
        ASSERT_EQ(parent, SurfacePaths::kFree);
    }
    EXPECT_EQ(binding.of_one_patch().all, 0U);
}

}  // namespace
}  // namespace haptic::sim
