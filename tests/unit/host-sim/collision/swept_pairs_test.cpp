#include "collision/swept_pairs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

#include "haptic/sim/collisions.hpp"

namespace haptic::sim {
namespace {

using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

struct Crowd {
    std::size_t boxes = 300;
    double width = 1.0;  // m, of the region
    double min_side = 0.01;
    double max_side = 0.1;
    std::uint32_t bodies = 4;
};

std::vector<SweptBox> make(const Crowd& crowd, std::uint32_t seed) {
    std::mt19937 random(seed);
    const auto uniform = [&](double low, double high) {
        return std::uniform_real_distribution<double>(low, high)(random);
    };
    std::vector<SweptBox> boxes;
    for (std::uint32_t i = 0; i < crowd.boxes; ++i) {
        SweptBox box{.particle = i, .body = i * crowd.bodies / static_cast<std::uint32_t>(crowd.boxes)};
        for (int k = 0; k < 3; ++k) {
            box.box.min[k] = uniform(-0.5 * crowd.width, 0.5 * crowd.width);
            box.box.max[k] = box.box.min[k] + uniform(crowd.min_side, crowd.max_side);
        }
        boxes.push_back(box);
    }
    return boxes;
}

Pairs by_brute_force(const std::vector<SweptBox>& boxes) {
    Pairs pairs;
    for (std::uint32_t i = 0; i < boxes.size(); ++i) {
        for (std::uint32_t j = i + 1; j < boxes.size(); ++j) {
            bool excluded = boxes[i].body == boxes[j].body;
            for (int k = 0; k < 3; ++k) {
                excluded =
                    excluded || boxes[i].box.min[k] > boxes[j].box.max[k] || boxes[j].box.min[k] > boxes[i].box.max[k];
            }
            if (!excluded) {
                pairs.emplace_back(i, j);
            }
        }
    }
    return pairs;
}

const ColliderKernels& widest() {
    return collider_kernels(ParticleCollisions::kWidest);
}

enum class Method { Best, Grid };

Pairs found(SweptPairs& finder, const std::vector<SweptBox>& boxes, Method method = Method::Best) {
    std::vector<BoxPair> room(boxes.size() * boxes.size() + 1);
    room.resize(method == Method::Grid ? finder.find_in_grid(boxes, room) : finder.find(boxes, room));
    Pairs pairs;
    for (const BoxPair& p : room) {
        pairs.emplace_back(std::min(p.first, p.second), std::max(p.first, p.second));
    }
    return pairs;
}

TEST(SweptPairs, AreThoseOfBruteForceEachOnce) {
    std::size_t seen = 0;
    std::uint32_t seed = 0;
    for (const Crowd& crowd : {Crowd{}, Crowd{.width = 0.2}, Crowd{.width = 50.0},
                               Crowd{.min_side = 0.0, .max_side = 0.0}, Crowd{.boxes = 400, .max_side = 0.9},
                               Crowd{.width = 1e9, .max_side = 3e8}, Crowd{.boxes = 2, .max_side = 2.0, .bodies = 2},
                               Crowd{.boxes = 1}, Crowd{.boxes = 0}, Crowd{.bodies = 300}, Crowd{.bodies = 1}}) {
        for (int round = 0; round < 5; ++round) {
            const std::vector<SweptBox> boxes = make(crowd, ++seed);
            const Pairs expected = by_brute_force(boxes);
            Pairs in_order;
            for (const std::size_t lanes : ParticleCollisions::usable_lanes()) {
                SweptPairs finder(400, collider_kernels(lanes));
                Pairs pairs = found(finder, boxes);
                ASSERT_EQ(pairs, lanes == 1 ? pairs : in_order) << seed << " with " << lanes << " lanes";
                in_order = pairs;
                std::sort(pairs.begin(), pairs.end());
                ASSERT_EQ(pairs, expected) << seed << " with " << lanes << " lanes";
            }
            SweptPairs finder(400, widest());
            Pairs pairs = found(finder, boxes, Method::Grid);
            std::sort(pairs.begin(), pairs.end());
            ASSERT_EQ(pairs, expected) << seed;
            seen += expected.size();
        }
    }
    EXPECT_GT(seen, 10000u);
}

TEST(SweptPairs, OfMoreBoxesThanAreComparedOrOfBodiesWithLargeNumbersAreFoundAllTheSame) {
    // All begin in one slice along every axis, and hardly two of them overlap.
    std::vector<SweptBox> boxes = make({.boxes = 2500, .min_side = 0.0, .max_side = 0.01}, 4);
    boxes.push_back({.box = {Vec3(999.0), Vec3(1000.0)}, .body = 9});
    SweptPairs finder(boxes.size(), widest());
    Pairs pairs = found(finder, boxes);
    EXPECT_EQ(pairs, found(finder, boxes, Method::Grid));  // by the grid, as the order shows
    std::sort(pairs.begin(), pairs.end());
    EXPECT_EQ(pairs, by_brute_force(boxes));

    boxes = make({}, 5);
    for (SweptBox& box : boxes) {
        box.body *= 65536;  // the lower halves are equal
    }
    pairs = found(finder, boxes);
    std::sort(pairs.begin(), pairs.end());
    EXPECT_EQ(pairs, by_brute_force(boxes));
    EXPECT_FALSE(pairs.empty());
}

TEST(SweptPairs, FarFromOneAnotherThanThereAreCellsShareTheLastOne) {
    std::vector<SweptBox> boxes = make({.boxes = 60}, 1);
    for (SweptBox& box : make({.boxes = 60}, 2)) {
        box.box.min += Vec3(1e9, -1e9, 0.0);
        box.box.max += Vec3(1e9, -1e9, 0.0);
        boxes.push_back(box);
    }
    SweptPairs finder(boxes.size(), widest());
    Pairs pairs = found(finder, boxes);
    std::sort(pairs.begin(), pairs.end());
    EXPECT_EQ(pairs, by_brute_force(boxes));
    EXPECT_FALSE(pairs.empty());
}

TEST(SweptPairs, ComeInTheSameOrderWhateverWasFoundBefore) {
    const std::vector<SweptBox> boxes = make({}, 7);
    SweptPairs fresh(300, widest());
    SweptPairs used(300, widest());
    (void)found(used, make({.width = 0.3}, 8));
    for (const Method method : {Method::Best, Method::Grid}) {
        EXPECT_EQ(found(fresh, boxes, method), found(used, boxes, method));
    }
}

TEST(SweptPairs, ThatFindNoRoomAreCounted) {
    const std::vector<SweptBox> boxes = make({.width = 0.2}, 9);
    SweptPairs finder(300, widest());
    std::vector<BoxPair> room(10);
    EXPECT_EQ(finder.find(boxes, room), by_brute_force(boxes).size());
    EXPECT_EQ(finder.find_in_grid(boxes, room), by_brute_force(boxes).size());
    EXPECT_LT(room.back().first, 300u);
    EXPECT_NE(room.back().first, room.back().second);
}

}  // namespace
}  // namespace haptic::sim
