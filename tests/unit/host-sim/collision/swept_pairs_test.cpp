#include "collision/swept_pairs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

#include <haptic/sim/collisions.hpp>

namespace haptic::sim {
namespace {

using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

struct Crowd {
    std::size_t boxes = 300;
    double width = 1.0;  // m, of the region
    double least = 0.01;
    double greatest = 0.1;
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
            box.low[k] = uniform(-0.5 * crowd.width, 0.5 * crowd.width);
            box.high[k] = box.low[k] + uniform(crowd.least, crowd.greatest);
        }
        boxes.push_back(box);
    }
    return boxes;
}

Pairs by_brute_force(const std::vector<SweptBox>& boxes) {
    Pairs pairs;
    for (std::uint32_t i = 0; i < boxes.size(); ++i) {
        for (std::uint32_t j = i + 1; j < boxes.size(); ++j) {
            bool apart = boxes[i].body == boxes[j].body;
            for (int k = 0; k < 3; ++k) {
                apart = apart || boxes[i].low[k] > boxes[j].high[k] || boxes[j].low[k] > boxes[i].high[k];
            }
            if (!apart) {
                pairs.emplace_back(i, j);
            }
        }
    }
    return pairs;
}

const ColliderKernels& widest() {
    return collider_kernels(ParticleCollisions::kWidest);
}

enum class Way { Best, Grid };

Pairs found(SweptPairs& finder, const std::vector<SweptBox>& boxes, Way way = Way::Best) {
    std::vector<BoxPair> room(boxes.size() * boxes.size() + 1);
    room.resize(way == Way::Grid ? finder.find_in_grid(boxes, room) : finder.find(boxes, room));
    Pairs pairs;
    for (const BoxPair& p : room) {
        pairs.emplace_back(std::min(p.first, p.second), std::max(p.first, p.second));
    }
    return pairs;
}

TEST(SweptPairs, AreThoseOfBruteForceEachOnce) {
    std::size_t seen = 0;
    std::uint32_t seed = 0;
    for (const Crowd& crowd : {Crowd{}, Crowd{.width = 0.2}, Crowd{.width = 50.0}, Crowd{.least = 0.0, .greatest = 0.0},
                               Crowd{.boxes = 400, .greatest = 0.9}, Crowd{.width = 1e9, .greatest = 3e8},
                               Crowd{.boxes = 2, .greatest = 2.0, .bodies = 2}, Crowd{.boxes = 1}, Crowd{.boxes = 0},
                               Crowd{.bodies = 300}, Crowd{.bodies = 1}}) {
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
            Pairs pairs = found(finder, boxes, Way::Grid);
            std::sort(pairs.begin(), pairs.end());
            ASSERT_EQ(pairs, expected) << seed;
            seen += expected.size();
        }
    }
    EXPECT_GT(seen, 10000u);
}

TEST(SweptPairs, OfMoreBoxesThanAreComparedOrOfBodiesWithLargeNumbersAreFoundAllTheSame) {
    // All begin in one slice along every axis, and hardly two of them overlap.
    std::vector<SweptBox> boxes = make({.boxes = 2500, .least = 0.0, .greatest = 0.01}, 4);
    boxes.push_back({.low = Vec3(999.0), .high = Vec3(1000.0), .body = 9});
    SweptPairs finder(boxes.size(), widest());
    Pairs pairs = found(finder, boxes);
    EXPECT_EQ(pairs, found(finder, boxes, Way::Grid));  // by the grid indeed: in its order
    std::sort(pairs.begin(), pairs.end());
    EXPECT_EQ(pairs, by_brute_force(boxes));

    boxes = make({}, 5);
    for (SweptBox& box : boxes) {
        box.body *= 65536;  // whose lower halves are alike
    }
    pairs = found(finder, boxes);
    std::sort(pairs.begin(), pairs.end());
    EXPECT_EQ(pairs, by_brute_force(boxes));
    EXPECT_FALSE(pairs.empty());
}

TEST(SweptPairs, FarFromOneAnotherThanThereAreCellsShareTheLastOne) {
    std::vector<SweptBox> boxes = make({.boxes = 60}, 1);
    for (SweptBox& box : make({.boxes = 60}, 2)) {
        box.low += Vec3(1e9, -1e9, 0.0);
        box.high += Vec3(1e9, -1e9, 0.0);
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
    for (const Way way : {Way::Best, Way::Grid}) {
        EXPECT_EQ(found(fresh, boxes, way), found(used, boxes, way));
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
