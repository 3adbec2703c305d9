// Surfaces that are asked to pass through one another, step by step, whatever the particles beneath may do.
#include "collision/solid_surfaces.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "collision/feature_distance.hpp"
#include "dynamics/workers.hpp"
#include "haptic/sim/block.hpp"
#include "haptic/sim/collisions.hpp"
#include "verification/surface_crossings.hpp"

namespace haptic::sim {
namespace {

/// Where a body is asked to be: a rotation about its centre, a place, and a stretch.
struct Asked {
    Vec3 position{0.0};
    Quat orientation{1.0, 0.0, 0.0, 0.0};
    Vec3 stretch{1.0};
};

/// Blocks of 0.06 x 0.04 x 0.04 m, in steps.
class Blocks {
  public:
    explicit Blocks(const std::vector<Asked>& at, std::vector<std::uint8_t> movable = {}, double floor = -1e9,
                    int threads = 1, std::size_t lanes = ParticleCollisions::kWidest)
        : block_(make_block_mesh({.size = {0.06, 0.04, 0.04}, .cells = 6})), workers_(threads) {
        movable.resize(at.size(), 1);
        for (std::size_t b = 0; b < at.size(); ++b) {
            trees_.emplace_back(block_.vertices, block_.triangles);
        }
        floor_ = floor;
        end_ = placed(at);
        start_ = asked_ = end_;
        for (std::size_t b = 0; b < at.size(); ++b) {
            trees_[b].refit({of(start_, b), of(end_, b), block_.triangles});
        }
        std::vector<CheckedSurface> checked;
        std::vector<SolidSurface> surfaces;
        for (std::size_t b = 0; b < at.size(); ++b) {
            checked.push_back({block_.triangles, b * size()});
            surfaces.push_back({.tree = &trees_[b],
                                .triangles = block_.triangles,
                                .first_vertex = b * size(),
                                .vertices = size(),
                                .movable = movable[b] == 1,
                                .exact = movable[b] == 2,
                                .floor = floor});
        }
        crossings_ = std::make_unique<SurfaceCrossings>(checked, end_);
        SurfacesAtStart left_alone;
        for (const SurfaceCrossing& c : crossings_->find(end_, 1e-12)) {
            left_alone.crossing.push_back({std::min(c.edge_object, c.object), std::max(c.edge_object, c.object)});
        }
        solids_ = std::make_unique<SolidSurfaces>(surfaces, end_, left_alone, kCatchUpSpeed, lanes);
    }

    /// Then they are to go as a whole, each with one of these motions.
    void carry(const std::vector<std::uint32_t>& by, const std::vector<RigidMotion>& motions) {
        solids_->carry(by, motions, start_, end_, workers_);
    }
    /// Then one of them shall not have moved.
    void let_stand(std::size_t block, const std::vector<Asked>& at_start) {
        std::vector<std::uint32_t> carried_by(trees_.size(), SolidSurfaces::kFollows);
        carried_by[block] = SolidSurfaces::kStands;
        std::ranges::copy(of(placed(at_start), block), end_.begin() + static_cast<std::ptrdiff_t>(block * size()));
        solids_->forget_lag(block);
        carry(carried_by, {});
    }
    /// Then one of them goes there at once. Its skin stays where it was.
    void jump(std::size_t block, const std::vector<Asked>& to) { solids_->jump(block, placed(to), start_, end_); }
    /// And its skin is there too.
    void jump_with_skin(std::size_t block, const std::vector<Asked>& to) {
        jump(block, to);
        solids_->forget_lag(block);
        asked_ = end_;
    }
    void step(const std::vector<Asked>& to) {
        start_ = end_;
        end_ = asked_ = placed(to);
        for (std::size_t b = 0; b < trees_.size(); ++b) {
            solids_->ask(b, end_, kStep);
            trees_[b].refit({of(start_, b), of(end_, b), block_.triangles});
        }
        solids_->keep_apart(start_, end_, workers_);
    }

    [[nodiscard]] std::size_t size() const { return block_.vertices.size(); }
    [[nodiscard]] const std::vector<Vec3>& end() const { return end_; }
    [[nodiscard]] const std::vector<Vec3>& asked() const { return asked_; }
    [[nodiscard]] std::span<const Vec3> start(std::size_t b) const { return of(start_, b); }
    [[nodiscard]] std::span<const Vec3> end(std::size_t b) const { return of(end_, b); }
    [[nodiscard]] const SolidSurfaces& solids() const { return *solids_; }
    /// Edges through another block, at moments of the way of the last step, with its end.
    [[nodiscard]] std::size_t crossings() const {
        std::size_t count = 0;
        for (int moment = 1; moment <= kMoments; ++moment) {
            std::vector<Vec3> at = start_;
            for (std::size_t v = 0; v < at.size(); ++v) {
                at[v] += static_cast<double>(moment) / kMoments * (end_[v] - start_[v]);
            }
            count += crossings_in(at);
        }
        return count;
    }
    /// Edges of one block through others, and of others through it.
    [[nodiscard]] std::size_t crossings_with(std::uint32_t block) const {
        return static_cast<std::size_t>(
            std::ranges::count_if(crossings_->find(end_, 0.0), [&](const SurfaceCrossing& c) {
                return c.edge_object != c.object && (c.edge_object == block || c.object == block);
            }));
    }
    [[nodiscard]] std::size_t asked_crossings() const { return crossings_in(asked_); }

    /// m, by which surfaces lag at most.
    [[nodiscard]] double lag() const {
        double most = 0.0;
        for (std::size_t v = 0; v < end_.size(); ++v) {
            most = std::max(most, glm::length(end_[v] - asked_[v]));
        }
        return most;
    }

    /// m, the least distance of a vertex or edge of the first block from the second.
    [[nodiscard]] double distance() const {
        double least = 1e9;
        const auto at = [&](std::size_t b, std::uint32_t v) { return end_[b * size() + v]; };
        for (const Triangle& t : block_.triangles) {
            for (const Triangle& u : block_.triangles) {
                for (std::size_t k = 0; k < 3; ++k) {
                    const auto of_vertex = [&](std::size_t b, std::size_t c) {
                        const Triangle& face = b == 0 ? u : t;
                        const FeatureVertices x{at(b, (b == 0 ? t : u)[k]), at(c, face[0]), at(c, face[1]),
                                                at(c, face[2])};
                        return nearest_points(PairKind::VertexTriangle, x).distance;
                    };
                    least = std::min({least, of_vertex(0, 1), of_vertex(1, 0)});
                    for (std::size_t l = 0; l < 3; ++l) {
                        const FeatureVertices x{at(0, t[k]), at(0, t[(k + 1) % 3]), at(1, u[l]), at(1, u[(l + 1) % 3])};
                        least = std::min(least, nearest_points(PairKind::EdgeEdge, x).distance);
                    }
                }
            }
        }
        return least;
    }

    static constexpr double kStep = 0.01;         // s
    static constexpr double kCatchUpSpeed = 0.2;  // m/s

  private:
    static constexpr int kMoments = 8;
    [[nodiscard]] std::size_t crossings_in(const std::vector<Vec3>& vertices) const {
        return static_cast<std::size_t>(std::ranges::count_if(
            crossings_->find(vertices, 0.0), [](const SurfaceCrossing& c) { return c.edge_object != c.object; }));
    }
    [[nodiscard]] std::span<const Vec3> of(const std::vector<Vec3>& all, std::size_t b) const {
        return std::span(all).subspan(b * size(), size());
    }
    [[nodiscard]] std::vector<Vec3> placed(const std::vector<Asked>& at) const {
        std::vector<Vec3> vertices;
        for (const Asked& a : at) {
            for (const Vec3& v : block_.vertices) {
                vertices.push_back(a.position + a.orientation * (a.stretch * v));
                vertices.back().y = std::max(vertices.back().y, floor_);  // no skin is below
            }
        }
        return vertices;
    }

    double floor_ = 0.0;
    TriangleMesh block_;
    Workers workers_;
    std::vector<SweptTree> trees_;
    std::vector<Vec3> start_;
    std::vector<Vec3> end_;
    std::vector<Vec3> asked_;
    std::unique_ptr<SurfaceCrossings> crossings_;
    std::unique_ptr<SolidSurfaces> solids_;
};

Quat turned(double angle, const Vec3& axis) {
    const Vec3 n = std::sin(0.5 * angle) * glm::normalize(axis);
    return {std::cos(0.5 * angle), n.x, n.y, n.z};
}

/// Two blocks that turn and are asked to pass through one another, so many m a step.
std::vector<Asked> thrown(double way, int step, const Vec3& common = Vec3(0.0)) {
    const double x = 0.1 - step * way;
    const Vec3 along = static_cast<double>(step) * common;
    return {{along + Vec3(x, 0.003, 0.0), turned(0.3 + 0.02 * step, {1.0, 2.0, 3.0})},
            {along + Vec3(-x, 0.0, 0.002), turned(0.5 - 0.03 * step, {2.0, 1.0, -1.0})}};
}

class ThrownSolids : public ::testing::TestWithParam<double> {};

TEST_P(ThrownSolids, NeverCrossAndKeepTheGap) {
    const double way = GetParam();
    Blocks blocks(thrown(way, 0));
    std::size_t asked = 0;
    const int steps = static_cast<int>(0.25 / way) + 3;
    for (int k = 1; k <= steps; ++k) {
        blocks.step(thrown(way, k));
        asked += blocks.asked_crossings();
        ASSERT_EQ(blocks.crossings(), 0u) << k;
        if (k % std::max(1, steps / 20) == 0) {
            ASSERT_GE(blocks.distance(), 0.999 * blocks.solids().least_gap()) << k;
        }
    }
    EXPECT_GT(asked, 0u) << "nothing was in the way";
    EXPECT_GT(blocks.solids().counts().unsafe, 0u);
}

INSTANTIATE_TEST_SUITE_P(Ways, ThrownSolids, ::testing::Values(0.0005, 0.002, 0.01, 0.03, 0.07));

TEST(SolidSurfaces, FollowAgainAsSoonAsThereIsRoom) {
    Blocks blocks(thrown(0.002, 0));
    for (int k = 1; k <= 44; ++k) {  // as far into one another as 50 mm
        blocks.step(thrown(0.002, k));
    }
    EXPECT_GT(blocks.lag(), 0.005);
    for (int k = 43; k >= 0; --k) {
        blocks.step(thrown(0.002, k));
        ASSERT_EQ(blocks.crossings(), 0u) << k;
    }
    EXPECT_EQ(blocks.lag(), 0.0);
}

TEST(SolidSurfaces, GoWhereTheyAreAskedToWhereNothingIsInTheWay) {
    // Side by side, 1 mm apart, at 30 m/s.
    const auto at = [](int k) {
        const Vec3 position(0.3 * k, -0.1 * k, 0.0);
        return std::vector<Asked>{{position}, {position + Vec3(0.0, 0.041, 0.0)}};
    };
    Blocks blocks(at(0));
    for (int k = 1; k < 10; ++k) {
        blocks.step(at(k));
        EXPECT_EQ(blocks.end(), blocks.asked()) << k;
        EXPECT_FALSE(blocks.solids().lags(0) || blocks.solids().lags(1)) << k;
    }
}

TEST(SolidSurfaces, LieOnOneAnotherAlikeHoweverFastTheyMoveTogether) {
    // The upper one is asked to be 0.3 mm within the lower one.
    const auto lag_at = [](const Vec3& common) {
        const auto at = [&](int k) {
            const Vec3 along = static_cast<double>(k) * common;
            return std::vector<Asked>{{along}, {along + Vec3(0.003, 0.0403 - std::min(0.0006, 0.0001 * k), 0.0)}};
        };
        Blocks blocks(at(0));
        for (int k = 1; k <= 60; ++k) {
            blocks.step(at(k));
            EXPECT_EQ(blocks.crossings(), 0u) << k;
        }
        EXPECT_EQ(blocks.solids().counts().stuck, 0u);
        return blocks.lag();
    };
    const double at_rest = lag_at(Vec3(0.0));
    EXPECT_GT(at_rest, 0.0001);
    EXPECT_LT(at_rest, 0.0004);
    EXPECT_NEAR(lag_at({0.02, -0.1, 0.03}), at_rest, 0.0001);
}

TEST(SolidSurfaces, LeaveWhatIsFixedWhereItIsAndStayAboveTheFloor) {
    // It grows between a fixed block and the floor, to 24 mm more than there is room for.
    const double floor = -0.021;
    std::vector<Asked> asked{{}, {{0.005, 0.045, 0.0}}};
    Blocks blocks(asked, {1, 0}, floor);
    const std::vector<Vec3> before(blocks.end(1).begin(), blocks.end(1).end());
    for (int k = 1; k <= 20; ++k) {
        asked[0].stretch.y = 1.0 + 0.04 * k;
        blocks.step(asked);
        ASSERT_EQ(blocks.crossings(), 0u) << k;
        ASSERT_TRUE(std::ranges::equal(blocks.end(1), before)) << k;
        ASSERT_GE(std::ranges::min(blocks.end(0), {}, &Vec3::y).y, floor) << k;
    }
    EXPECT_GT(blocks.lag(), 0.009);
}

TEST(SolidSurfaces, GiveWayToWhatIsLed) {
    // A script leads a block that cannot be pushed against another one, which stays where it is asked to be.
    const auto at = [](int k) { return std::vector<Asked>{{{0.001 * k, 0.0, 0.0}}, {{0.065, 0.002, 0.001}}}; };
    Blocks blocks(at(0), {0, 1});
    for (int k = 1; k <= 20; ++k) {
        blocks.step(at(k));
        ASSERT_EQ(blocks.crossings(), 0u) << k;
        ASSERT_TRUE(std::ranges::equal(blocks.end(0), std::span(blocks.asked()).first(blocks.size()))) << k;
    }
    EXPECT_GT(blocks.lag(), 0.01);
}

/// Two blocks that lie side by side on one that leads exactly, as a sheet does, and rises, bulges, shears and turns.
void lead_exactly(double turn, int& stood) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    std::vector<Asked> asked{{{0.0, -0.041, 0.0}}, {{-0.031, 0.0, 0.0}}, {{0.031, 0.0, 0.0}}};
    Blocks blocks(asked, {2, 1, 1});
    stood = 0;
    for (int k = 1; k <= 60; ++k) {
        asked[0].position = {0.004 * std::sin(0.3 * k), -0.041 + 0.0002 * k, 0.0};
        asked[0].orientation = turned(turn * std::sin(0.3 * k), {0.3, 1.0, 1.0});
        asked[0].stretch = {1.0 + 0.01 * uniform(random), 1.0, 1.0 + 0.01 * uniform(random)};
        const bool lagged = blocks.solids().lags(0);
        blocks.step(asked);
        ASSERT_EQ(blocks.crossings(), 0u) << k;
        stood += blocks.solids().is_carried(0) ? 1 : 0;
        const std::span<const Vec3> led = std::span(blocks.asked()).first(blocks.size());
        ASSERT_TRUE(lagged || std::ranges::equal(blocks.end(0), blocks.solids().is_carried(0) ? blocks.start(0) : led))
            << k;
    }
    EXPECT_GT(blocks.asked_crossings(), 10u);
    EXPECT_GT(blocks.lag(), 0.002);
}

TEST(SolidSurfaces, FollowWhatLeadsExactlyOrElseItStandsStill) {
    for (const double turn : {0.0, 0.2}) {
        int stood = 0;
        lead_exactly(turn, stood);
        EXPECT_GT(stood, 0) << turn;
        EXPECT_LT(stood, turn > 0.0 ? 60 : 30) << turn;
    }
}

TEST(SolidSurfaces, StopBehindThoseThatAreToldToStandStill) {
    // The second goes where the first leaves at once, 30 mm in each step; in the fourth step the first may not.
    const auto at = [](int k) {
        const double way = 0.03 * k;
        return std::vector<Asked>{{{way, 0.0, 0.0}}, {{way - 0.061, 0.001, 0.0}}};
    };
    Blocks blocks(at(0));
    for (int k = 1; k <= 4; ++k) {
        blocks.step(at(k));
    }
    ASSERT_EQ(blocks.lag(), 0.0);
    blocks.let_stand(0, at(3));
    EXPECT_TRUE(std::ranges::equal(blocks.start(0), blocks.end(0)));
    EXPECT_FALSE(blocks.solids().lags(0)) << "its skin has not moved either";
    EXPECT_TRUE(blocks.solids().lags(1));
    EXPECT_EQ(blocks.crossings(), 0u);
    // And follows again, as fast as it may.
    for (int k = 0; k < 40; ++k) {
        blocks.step(at(4));
        ASSERT_EQ(blocks.crossings(), 0u) << k;
    }
    EXPECT_EQ(blocks.lag(), 0.0);
}

TEST(SolidSurfaces, GiveWayToSeveralThatAreLed) {
    // Three blocks that cannot be pushed are led into one another, and one between them that can.
    const auto at = [](int k) {
        const double way = 0.003 * k;
        return std::vector<Asked>{
            {{-0.07 + way, 0.0, 0.0}}, {{0.07 - way, 0.003, 0.0}}, {{0.0, 0.05 - way, 0.002}}, {}};
    };
    Blocks blocks(at(0), {0, 0, 0, 1});
    for (int k = 1; k <= 15; ++k) {
        blocks.step(at(k));
        // Those that cannot be pushed may cross one another.
        ASSERT_EQ(blocks.crossings_with(3), 0u) << k;
    }
}

TEST(SolidSurfaces, StandStillWhereThereIsNoOtherWay) {
    // Five blocks side by side that are asked to be anywhere among one another in each step.
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    const auto vector = [&] { return Vec3{uniform(random), uniform(random), uniform(random)}; };
    std::vector<Asked> asked;
    for (int b = 0; b < 5; ++b) {
        asked.push_back({{0.0, 0.045 * b, 0.0}});
    }
    Blocks blocks(asked);
    for (int k = 1; k <= 30; ++k) {
        for (Asked& of : asked) {
            of.position = 0.06 * vector();
            of.orientation = turned(3.0 * uniform(random), vector());
        }
        blocks.step(asked);
        ASSERT_EQ(blocks.crossings(), 0u) << k;
    }
    EXPECT_GT(blocks.asked_crossings(), 100u);
    EXPECT_GT(blocks.solids().counts().stuck, 0u);
}

TEST(SolidSurfaces, AreCarriedWhereThereIsRoomAndElseStandStill) {
    const std::vector<Asked> asked{{{-0.05, 0.0, 0.0}}, {{0.05, 0.0, 0.0}}, {{0.0, 0.1, 0.0}}};
    Blocks blocks(asked);
    blocks.step(asked);
    // The first two would pass through one another.
    const Vec3 free(0.02, 0.01, 0.0);
    blocks.carry({0, 1, 2}, {RigidMotion::by(Vec3(0.08, 0.0, 0.0)), RigidMotion::by(Vec3(-0.08, 0.0, 0.0)),
                             RigidMotion::by(free)});
    EXPECT_EQ(blocks.crossings(), 0u);
    EXPECT_TRUE(std::ranges::equal(blocks.end(0), blocks.start(0)));
    EXPECT_TRUE(std::ranges::equal(blocks.end(1), blocks.start(1)));
    for (std::size_t v = 0; v < blocks.size(); ++v) {
        EXPECT_EQ(blocks.end(2)[v], blocks.start(2)[v] + free);
    }
    EXPECT_TRUE(blocks.solids().lags(2));
    // They catch up.
    for (int k = 0; k < 20; ++k) {
        blocks.step(asked);
    }
    EXPECT_EQ(blocks.lag(), 0.0);
}

TEST(SolidSurfaces, LetOtherHeapsGoWhereOneMustStand) {
    // Each of a row would run into the one before it, once that has had to stop, and the first one into a wall.
    const std::vector<Asked> asked{{},
                                   {{0.07, 0.0, 0.0}},
                                   {{0.14, 0.0, 0.0}},
                                   {{0.21, 0.0, 0.0}},
                                   {{0.28, 0.0, 0.0}},
                                   {{0.35, 0.0, 0.0}},
                                   {{0.0, 0.5, 0.0}},
                                   {{0.07, 0.5, 0.0}},
                                   {{-0.01, 0.045, 0.0}}};
    Blocks blocks(asked, {0, 1, 1, 1, 1, 1, 1, 1, 1});
    blocks.step(asked);
    // Others leave one that stands anyway, or the same wall.
    const Vec3 way(-0.03, 0.0, 0.0);
    const std::vector<RigidMotion> motions(7, RigidMotion::by(way));
    blocks.carry({SolidSurfaces::kFollows, 0, 1, 2, 3, 4, 5, SolidSurfaces::kStands, 6}, motions);
    EXPECT_EQ(blocks.crossings(), 0U);
    EXPECT_GE(blocks.solids().counts().stuck, 3U);
    for (std::size_t b = 1; b <= 5; ++b) {
        EXPECT_TRUE(blocks.solids().stands(b)) << b;
    }
    for (const std::size_t b : {std::size_t{6}, std::size_t{8}}) {
        EXPECT_FALSE(blocks.solids().stands(b)) << b;
        EXPECT_EQ(blocks.end(b)[0], blocks.start(b)[0] + way) << b;
    }
}

TEST(SolidSurfaces, AreCarriedAtOnceWhereTheyWouldBeTurnedInsideOut) {
    Blocks blocks(std::vector<Asked>(1));
    // Every vertex through the centre: no pair is looked at by itself.
    const Vec3 way(0.01, 0.0, 0.002);
    blocks.step({{.position = way, .stretch = Vec3(-1.0)}});
    EXPECT_TRUE(blocks.solids().is_carried(0));
    EXPECT_EQ(blocks.solids().counts().stuck, 1u);
    EXPECT_EQ(blocks.solids().counts().unsafe, 0u);
    for (std::size_t v = 0; v < blocks.size(); ++v) {
        EXPECT_LT(glm::distance(blocks.end(0)[v], blocks.start(0)[v] + way), 1e-15);
    }
}

TEST(SolidSurfaces, TurnAsOneHoweverNearTheyAre) {
    // Pressed together as near as they come.
    const std::vector<Asked> pressed{{{0.0, 0.0, 0.0}}, {{0.004, 0.035, 0.0}}};
    Blocks blocks({pressed[0], {{0.004, 0.045, 0.0}}});
    blocks.step(pressed);
    const double apart = blocks.distance();
    ASSERT_LT(apart, 3.0 * blocks.solids().least_gap());
    Vec3 centre(0.0);
    for (int k = 0; k < 20; ++k) {
        blocks.step(pressed);
        const RigidMotion motion(centre, Vec3(0.1, -0.1, 0.2), Vec3(0.01, 0.0, 0.0));
        blocks.carry({0, 0}, {motion});
        for (std::size_t v = 0; v < blocks.end().size(); ++v) {
            const Vec3 start = v < blocks.size() ? blocks.start(0)[v] : blocks.start(1)[v - blocks.size()];
            ASSERT_EQ(blocks.end()[v], motion(start)) << k;
        }
        ASSERT_EQ(blocks.crossings(), 0u) << k;
        ASSERT_NEAR(blocks.distance(), apart, 1e-12) << k;
        centre = motion(centre);
    }
}

TEST(SolidSurfaces, StandWithWhatMovesAsTheyDo) {
    // The first two make one motion, which leads the second into the third, and the fourth another one.
    const std::vector<Asked> at{{}, {{0.1, 0.0, 0.0}}, {{0.17, 0.0, 0.0}}, {{0.0, 0.5, 0.0}}};
    Blocks blocks(at, {1, 1, 0, 1});
    blocks.step(at);
    const std::vector<RigidMotion> motions{RigidMotion(Vec3(0.0), Vec3(0.0, 0.1, 0.0), Vec3(0.03, 0.0, 0.0)),
                                           RigidMotion(Vec3(0.0), Vec3(0.2, 0.1, 0.0), Vec3(0.0, 0.1, 0.0))};
    const auto expect_other_motion = [&] {
        for (std::size_t v = 0; v < blocks.size(); ++v) {
            EXPECT_EQ(blocks.end(3)[v], motions[1](blocks.start(3)[v]));
        }
    };
    blocks.carry({0, 0, SolidSurfaces::kFollows, 1}, motions);
    for (const std::size_t b : {0U, 1U}) {
        EXPECT_TRUE(std::ranges::equal(blocks.end(b), blocks.start(b))) << b;
        EXPECT_TRUE(blocks.solids().stands(b)) << b;
    }
    EXPECT_EQ(blocks.crossings(), 0u);
    EXPECT_FALSE(blocks.solids().stands(3));
    expect_other_motion();
    // Also if the others are let stand, and if it is asked for again.
    blocks.carry({SolidSurfaces::kStands, SolidSurfaces::kStands, SolidSurfaces::kFollows, 1}, motions);
    expect_other_motion();
    EXPECT_NEAR(blocks.solids().most_lag()[3], blocks.lag(), 1e-12);
}

TEST(SolidSurfaces, CatchUpFromWhereTheyHaveJumped) {
    const std::vector<Asked> home(1);
    Blocks blocks(home);
    blocks.step(home);
    blocks.jump(0, {{.position = {0.003, 0.0, 0.0}}});
    EXPECT_TRUE(std::ranges::equal(blocks.start(0), blocks.end(0)));
    EXPECT_NEAR(blocks.lag(), 0.003, 1e-15);
    EXPECT_NEAR(blocks.solids().most_lag()[0], 0.003, 1e-15);
    std::vector<Vec3> skin = blocks.end();
    blocks.solids().write_skin(0, blocks.end(), skin);
    for (std::size_t v = 0; v < skin.size(); ++v) {
        EXPECT_LT(glm::distance(skin[v], blocks.asked()[v]), 1e-15);
    }
    blocks.step(home);
    EXPECT_NEAR(blocks.lag(), 0.001, 1e-15);
    for (int k = 0; k < 3; ++k) {
        blocks.step(home);
    }
    EXPECT_FALSE(blocks.solids().lags(0));
}

TEST(SolidSurfaces, AreKeptFromThemselvesFromWhereTheyHaveJumped) {
    // Pressed through itself, from top to bottom.
    const auto flat = [](double height) { return std::vector<Asked>{{.stretch = {1.0, height, 1.0}}}; };
    Blocks blocks(flat(1.0));
    blocks.step(flat(-0.5));
    EXPECT_TRUE(blocks.solids().lags(0));
    for (const double height : {2.0, 1.0, -1.0}) {
        blocks.jump_with_skin(0, flat(height));
        EXPECT_FALSE(blocks.solids().lags(0));
        EXPECT_TRUE(std::ranges::equal(blocks.start(0), blocks.end(0)));
        blocks.step(flat(height));
        EXPECT_EQ(blocks.lag(), 0.0);
    }
    // Top and bottom are 0.4 mm apart now, and would pass through one another; from before the jump they would not.
    blocks.jump_with_skin(0, flat(0.01));
    blocks.step(flat(-0.01));
    EXPECT_TRUE(blocks.solids().lags(0));
}

TEST(SolidSurfaces, KeepAHeapApart) {
    // Five blocks in a row that are pressed together to half their height, and turned.
    const auto at = [](int k) {
        std::vector<Asked> heap;
        for (int b = 0; b < 5; ++b) {
            heap.push_back({.position = {0.002 * b, (0.042 - 0.0005 * k) * b, 0.001 * b},
                            .orientation = turned(0.4 * b + 0.01 * k * (b % 2), {0.0, 1.0, 0.0}),
                            .stretch = {1.0, 1.0, 1.0}});
        }
        return heap;
    };
    Blocks blocks(at(0));
    for (int k = 1; k <= 40; ++k) {
        blocks.step(at(k));
        ASSERT_EQ(blocks.crossings(), 0u) << k;
    }
    EXPECT_GT(blocks.asked_crossings(), 100u);
}

TEST(SolidSurfaces, LeaveThoseAloneThatCrossAtTheBeginningUntilTheyPart) {
    const auto at = [](double x) { return std::vector<Asked>{{}, {{x, 0.003, 0.002}, turned(0.1, {1.0, 1.0, 0.0})}}; };
    Blocks blocks(at(0.03));
    EXPECT_FALSE(blocks.solids().keeps_apart(1, 0));
    const auto move = [&](double from, double to) {
        for (int k = 1; k <= 20; ++k) {
            blocks.step(at(from + 0.05 * k * (to - from)));
        }
    };
    move(0.03, 0.04);
    EXPECT_EQ(blocks.lag(), 0.0);
    EXPECT_GT(blocks.crossings(), 0u);
    move(0.04, 0.09);
    EXPECT_EQ(blocks.lag(), 0.0);
    EXPECT_TRUE(blocks.solids().keeps_apart(1, 0));
    move(0.09, 0.03);
    EXPECT_EQ(blocks.crossings(), 0u);
    EXPECT_GT(blocks.lag(), 0.0);
}

TEST(SolidSurfaces, LeaveThoseAloneThatTouchAtTheBeginning) {
    // Face to face, to the bit: nothing tells which side of a face the other one is on.
    const auto at = [](double y) { return std::vector<Asked>{{}, {{0.003, y, 0.0}}}; };
    Blocks blocks(at(0.04));
    EXPECT_FALSE(blocks.solids().keeps_apart(0, 1));
    blocks.step(at(0.0395));
    EXPECT_EQ(blocks.lag(), 0.0);
    blocks.step(at(0.06));
    blocks.step(at(0.06));
    EXPECT_TRUE(blocks.solids().keeps_apart(0, 1));
    blocks.step(at(0.0395));
    EXPECT_EQ(blocks.crossings(), 0u);
}

TEST(SolidSurfaces, CatchUpAtTheirSpeed) {
    // The upper block is asked to sink 10 mm into a fixed one, then above it.
    const auto at = [](double y) { return std::vector<Asked>{{}, {{0.0, y, 0.0}}}; };
    Blocks blocks(at(0.041), {0, 1});
    for (int k = 1; k <= 20; ++k) {
        blocks.step(at(0.041 - 0.0005 * k));
    }
    double left = blocks.lag();
    EXPECT_GT(left, 0.008);
    while (left > 0.0) {
        left = std::max(0.0, left - Blocks::kCatchUpSpeed * Blocks::kStep);
        blocks.step(at(0.06));
        ASSERT_NEAR(blocks.lag(), left, 1e-9);
    }
}

TEST(SolidSurfaces, HaveTheSameBitsWithAnyNumberOfLanesAndThreads) {
    std::vector<std::vector<Vec3>> ends;
    for (const int threads : {1, 2, 3}) {
        for (const std::size_t lanes : ParticleCollisions::usable_lanes()) {
            Blocks blocks(thrown(0.004, 0), {}, -1e9, threads, lanes);
            for (int k = 1; k <= 40; ++k) {
                blocks.step(thrown(0.004, k));
            }
            ends.push_back(blocks.end());
        }
    }
    for (const std::vector<Vec3>& end : ends) {
        EXPECT_EQ(end, ends.front());
    }
}

TEST(FeatureBlocks, AreApartOnlyWhereAllTheirCornersAre) {
    // Two triangles each, at random, near and far from the origin.
    std::mt19937 random(7);
    std::uniform_real_distribution<double> in(-1.0, 1.0);
    const auto some = [&] { return Vec3{in(random), in(random), in(random)}; };
    int apart = 0;
    for (int k = 0; k < 3000; ++k) {
        FeatureBlocks blocks(collider_kernels(ParticleCollisions::kWidest));
        blocks.add_surface(std::vector<Triangle>{{0, 1, 2}, {1, 2, 3}}, std::vector<std::uint32_t>{2});
        blocks.add_surface(std::vector<Triangle>{{4, 5, 6}, {5, 6, 7}}, std::vector<std::uint32_t>{2});
        blocks.make_boxes();
        const Vec3 far = (k % 3 == 0 ? 100.0 : 0.0) * some();
        std::vector<Vec3> start;
        std::vector<Vec3> end;
        for (int v = 0; v < 8; ++v) {
            start.push_back(far + some() + (v < 4 ? Vec3(0.0) : Vec3(1.5, 0.5, 0.0)));
            end.push_back(start.back() + 0.3 * some());
        }
        for (std::size_t b = 0; b < 2; ++b) {
            blocks.place(b, [&](std::uint32_t v) { return std::pair(start[v], end[v]); });
        }
        const double gap = 0.1;
        if (!blocks.are_apart(0, 1, gap + FeatureBlocks::rounding_of_places(103.0))) {
            continue;
        }
        ++apart;
        // At some moments of the way, the nearest points of all features.
        for (int m = 0; m <= 8; ++m) {
            const auto at = [&](std::uint32_t v) { return start[v] + 0.125 * m * (end[v] - start[v]); };
            for (const Triangle& t : {Triangle{0, 1, 2}, Triangle{1, 2, 3}}) {
                for (const Triangle& u : {Triangle{4, 5, 6}, Triangle{5, 6, 7}}) {
                    for (std::size_t c = 0; c < 3; ++c) {
                        const FeatureVertices x{at(t[c]), at(u[0]), at(u[1]), at(u[2])};
                        ASSERT_GE(nearest_points(PairKind::VertexTriangle, x).distance, gap);
                        const FeatureVertices z{at(u[c]), at(t[0]), at(t[1]), at(t[2])};
                        ASSERT_GE(nearest_points(PairKind::VertexTriangle, z).distance, gap);
                        for (std::size_t d = 0; d < 3; ++d) {
                            const FeatureVertices y{at(t[c]), at(t[(c + 1) % 3]), at(u[d]), at(u[(d + 1) % 3])};
                            ASSERT_GE(nearest_points(PairKind::EdgeEdge, y).distance, gap);
                        }
                    }
                }
            }
        }
    }
    EXPECT_GT(apart, 300);
}

}  // namespace
}  // namespace haptic::sim
