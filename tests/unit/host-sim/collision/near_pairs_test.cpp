#include "collision/near_pairs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "haptic/sim/collisions.hpp"

namespace haptic::sim {
namespace {

using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

struct Crowd {
    std::uint32_t boxes = 300;
    double width = 1.0;      // m, of the region of a body
    double far = 0.0;        // m, from one body to the next
    double min_side = 0.01;  // m
    double max_side = 0.1;   // m
    std::uint32_t bodies = 4;
};

/// Boxes of the particles of several bodies, in the rows of colliders.
class CrowdedBoxes {
  public:
    CrowdedBoxes(const Crowd& crowd, std::uint32_t seed)
        : length_(crowd.boxes + 8), number_(collider_row::kCount * length_), count_(crowd.boxes) {
        std::mt19937 random(seed);
        const auto uniform = [&](double low, double high) {
            return std::uniform_real_distribution<double>(low, high)(random);
        };
        for (std::uint32_t b = 0; b < crowd.bodies; ++b) {
            bodies.push_back({b * crowd.boxes / crowd.bodies, (b + 1) * crowd.boxes / crowd.bodies});
            for (std::uint32_t i = bodies[b].begin; i < bodies[b].end; ++i) {
                at(collider_row::kSize, i) = 0.01;
                for (std::size_t k = 0; k < 3; ++k) {
                    const double low = uniform(-0.5 * crowd.width, 0.5 * crowd.width) + crowd.far * b;
                    at(collider_row::kLow + k, i) = low;
                    at(collider_row::kHigh + k, i) = low + uniform(crowd.min_side, crowd.max_side);
                }
            }
        }
        find_bounds();
    }
    [[nodiscard]] double& at(std::size_t row, std::size_t particle) { return number_[row * length_ + particle]; }
    [[nodiscard]] ColliderRows rows() { return {number_.data(), length_}; }
    void find_bounds() {
        bounds.clear();
        for (const ParticleRange& body : bodies) {
            bounds.push_back(collider_kernels(1).bounds(rows(), body.begin, body.end));
        }
    }
    /// Moves a box by a vector, m, whose length its travel gets.
    void move(std::uint32_t i, const Vec3& by) {
        for (std::size_t k = 0; k < 3; ++k) {
            at(collider_row::kLow + k, i) += by[static_cast<int>(k)];
            at(collider_row::kHigh + k, i) += by[static_cast<int>(k)];
        }
        at(collider_row::kTravel, i) += glm::length(by);
        at(collider_row::kTravelToEnd, i) = at(collider_row::kTravel, i);
    }
    [[nodiscard]] bool overlap(std::uint32_t i, std::uint32_t j) {
        bool both = true;
        for (std::size_t k = 0; k < 3; ++k) {
            both = both && at(collider_row::kLow + k, i) <= at(collider_row::kHigh + k, j) &&
                   at(collider_row::kLow + k, j) <= at(collider_row::kHigh + k, i);
        }
        return both;
    }
    [[nodiscard]] Pairs by_brute_force() {
        Pairs pairs;
        for (std::size_t a = 0; a < bodies.size(); ++a) {
            for (std::uint32_t i = bodies[a].begin; i < bodies[a].end; ++i) {
                for (std::uint32_t j = bodies[a].end; j < count_; ++j) {
                    if (overlap(i, j)) {
                        pairs.emplace_back(i, j);
                    }
                }
            }
        }
        return pairs;
    }

    std::vector<ParticleRange> bodies;
    std::vector<Bounds> bounds;

  private:
    std::size_t length_;
    std::vector<double> number_;
    std::uint32_t count_;
};

Pairs found_by(NearPairs& near, CrowdedBoxes& boxes) {
    const std::size_t bodies = near.find_bodies(boxes.bounds).size();
    near.find_particles(boxes.rows());
    Pairs pairs;
    for (std::size_t k = 0; k < bodies; ++k) {
        for (const NearPairs::Pair& p : near.particles(k)) {
            pairs.emplace_back(p.first, p.second);
        }
    }
    return pairs;
}

TEST(NearPairs, AreThoseOfBruteForceEachOnceWithAnyNumberOfLanes) {
    std::size_t seen = 0;
    std::uint32_t seed = 0;
    for (const Crowd& crowd :
         {Crowd{}, Crowd{.width = 0.2}, Crowd{.width = 50.0}, Crowd{.min_side = 0.0, .max_side = 0.0},
          Crowd{.boxes = 400, .max_side = 0.9}, Crowd{.width = 1e9, .max_side = 3e8}, Crowd{.far = 0.5},
          Crowd{.boxes = 600, .width = 0.5, .max_side = 0.02, .bodies = 2}, Crowd{.far = 1e6},
          Crowd{.boxes = 2, .max_side = 2.0, .bodies = 2}, Crowd{.boxes = 1, .bodies = 1}, Crowd{.bodies = 300},
          Crowd{.bodies = 1}}) {
        for (int round = 0; round < 5; ++round) {
            CrowdedBoxes boxes(crowd, ++seed);
            const Pairs expected = boxes.by_brute_force();
            Pairs in_order;
            for (const std::size_t lanes : ParticleCollisions::usable_lanes()) {
                NearPairs near(boxes.bodies, 200'000, collider_kernels(lanes));
                Pairs pairs = found_by(near, boxes);
                in_order = in_order.empty() ? pairs : in_order;
                ASSERT_EQ(pairs, in_order) << seed << " with " << lanes << " lanes";
                std::sort(pairs.begin(), pairs.end());
                ASSERT_EQ(pairs, expected) << seed << " with " << lanes << " lanes";
            }
            seen += expected.size();
        }
    }
    EXPECT_GT(seen, 10000u);
}

TEST(NearPairs, ComeInTheSameOrderWhateverWasFoundBefore) {
    CrowdedBoxes before({.width = 0.3}, 8);
    CrowdedBoxes boxes({}, 7);
    for (std::uint32_t i = 0; i < 300; ++i) {
        boxes.at(collider_row::kTravelToEnd, i) = 2.0;  // farther than from any of the boxes before
    }
    NearPairs fresh(boxes.bodies, 50'000, collider_kernels(ParticleCollisions::kWidest));
    NearPairs used(boxes.bodies, 50'000, collider_kernels(ParticleCollisions::kWidest));
    (void)found_by(used, before);
    EXPECT_EQ(found_by(fresh, boxes), found_by(used, boxes));
}

TEST(NearPairs, AreThoseOfBruteForceInOrderWhileBoxesMove) {
    // By a part of the margin in each round, so that most rounds choose among pairs that were kept.
    CrowdedBoxes boxes({.boxes = 200, .min_side = 0.05}, 11);
    NearPairs near(boxes.bodies, 50'000, collider_kernels(ParticleCollisions::kWidest));
    std::mt19937 random(12);
    std::uniform_real_distribution<double> shift(-0.002, 0.002);
    for (int round = 0; round < 100; ++round) {
        for (std::uint32_t i = 0; i < 200; ++i) {
            const double x = shift(random);
            const double y = shift(random);
            boxes.move(i, Vec3(x, y, shift(random)));
        }
        boxes.find_bounds();
        Pairs expected = boxes.by_brute_force();
        std::sort(expected.begin(), expected.end());
        Pairs pairs = found_by(near, boxes);
        NearPairs fresh(boxes.bodies, 50'000, collider_kernels(ParticleCollisions::kWidest));
        ASSERT_EQ(pairs, found_by(fresh, boxes)) << round;
        std::sort(pairs.begin(), pairs.end());
        ASSERT_EQ(pairs, expected) << round;
    }
}

TEST(NearPairs, ThatWereApartComeBackWhenTheyMayHaveMet) {
    CrowdedBoxes boxes({.boxes = 2, .width = 0.01, .max_side = 0.5, .bodies = 2}, 3);
    NearPairs near(boxes.bodies, 100, collider_kernels(ParticleCollisions::kWidest));
    ASSERT_EQ(found_by(near, boxes).size(), 1u);
    near.set_apart(near.particles(0)[0], 0.001, boxes.rows());
    EXPECT_TRUE(found_by(near, boxes).empty());
    boxes.move(0, Vec3(0.0, 0.0004, 0.0));
    boxes.move(1, Vec3(0.0004, 0.0, 0.0));
    EXPECT_TRUE(found_by(near, boxes).empty());
    boxes.move(1, Vec3(0.0, 0.0, -0.0003));
    EXPECT_EQ(found_by(near, boxes).size(), 1u);
}

TEST(NearPairs, HaveNoParticlesWithoutSizeOrPlace) {
    CrowdedBoxes boxes({.boxes = 2, .width = 0.01, .max_side = 0.5, .bodies = 2}, 3);
    NearPairs near(boxes.bodies, 100, collider_kernels(ParticleCollisions::kWidest));
    ASSERT_EQ(found_by(near, boxes).size(), 1u);
    boxes.at(collider_row::kSize, 1) = 0.0;
    EXPECT_TRUE(found_by(near, boxes).empty());
    boxes.at(collider_row::kSize, 1) = 0.01;
    for (const double nowhere : {std::numeric_limits<double>::quiet_NaN(), 1e15}) {
        boxes.at(collider_row::kHigh, 1) = nowhere;
        EXPECT_TRUE(found_by(near, boxes).empty()) << nowhere;
    }
}

TEST(NearPairs, ThatFindNoRoomAreCounted) {
    CrowdedBoxes boxes({.width = 0.2, .bodies = 2}, 9);
    NearPairs near(boxes.bodies, 10, collider_kernels(ParticleCollisions::kWidest));
    const std::size_t found = found_by(near, boxes).size();
    EXPECT_EQ(found, 10u);
    EXPECT_EQ(found + near.dropped(), boxes.by_brute_force().size());
}

}  // namespace
}  // namespace haptic::sim
