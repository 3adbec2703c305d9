// Pairs of features of sheets: whatever comes within the thickness is known.
#include "collision/sheet_pairs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "collision/colliders.hpp"
#include "collision/feature_pairs.hpp"
#include "collision/surface_features.hpp"
#include "dynamics/rows.hpp"
#include "haptic/sim/cloth.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"

namespace haptic::sim {
namespace {

constexpr std::uint32_t kAlongSide = 7;  // vertices
constexpr double kOfPairs = 0.004;
constexpr double kGapOfPairs = kOfPairs / 256.0;

TriangleMesh sheet_at(double height) {
    ClothShape shape;
    shape.vertices_per_side = kAlongSide;
    shape.side = 0.1;
    TriangleMesh mesh = make_cloth_mesh(shape);
    for (Vec3& x : mesh.vertices) {
        x.y += height;
    }
    return mesh;
}

/// Two sheets, one above the other, that wave and slide.
class TwoSheets {
  public:
    explicit TwoSheets(bool between_bodies = true)
        : mesh_{sheet_at(0.0), sheet_at(0.006)},
          surfaces_{ParticleSurface{.first_particle = 0, .triangles = mesh_[0].triangles, .rest = mesh_[0].vertices},
                    ParticleSurface{.first_particle = kAlongSide * kAlongSide,
                                    .triangles = mesh_[1].triangles,
                                    .rest = mesh_[1].vertices}},
          features_(surfaces_, collider_kernels(kWidestLanes)),
          pairs(features_, 2UL * kAlongSide * kAlongSide, surfaces_,
                {.thickness = kOfPairs, .least_gap = kGapOfPairs, .between_bodies = between_bodies}, kWidestLanes) {
        for (const TriangleMesh& mesh : mesh_) {
            for (const Vec3& x : mesh.vertices) {
                model.add(x, 0.001, 0.001);
            }
        }
    }
    /// m, at a time, s.
    [[nodiscard]] std::vector<Row> places(double time) const {
        std::vector<Row> rows;
        for (std::size_t i = 0; i < model.size(); ++i) {
            const Vec3& rest = model.rest_position[i];
            const double side = i < model.size() / 2 ? 1.0 : -1.0;
            const double wave = 0.004 * side * std::sin(60.0 * rest.x + 9.0 * time) * std::sin(3.0 * time);
            rows.push_back(row_of(rest + Vec3(0.03 * side * time, wave, 0.01 * std::sin(4.0 * time + 30.0 * rest.z))));
        }
        return rows;
    }
    void move_to(const std::vector<Row>& rows) {
        for (std::size_t i = 0; i < rows.size(); ++i) {
            model.position[i] = vector_of(rows[i]);
        }
    }
    /// Ends a sub-step, with the gaps there.
    void end(const std::vector<Row>& at) {
        for (FeaturePairs& of : pairs.near()) {
            for (std::size_t k = 0; k < of.size(); ++k) {
                of.end_gap[k] = of.gap_along(k, at.data());
            }
        }
        pairs.end(at.data());
    }
    void expect_gaps_at_start() {
        for (FeaturePairs& of : pairs.near()) {
            for (std::size_t k = 0; k < of.size(); ++k) {
                ASSERT_NEAR(of.gap[k], of.gap_along(k, pairs.start().data()), 1e-15);
            }
        }
    }
    using Known = std::set<PairVertices>;
    [[nodiscard]] std::array<Known, 2> known() {
        std::array<Known, 2> known;
        for (std::size_t list = 0; list < 2; ++list) {
            for (std::size_t k = 0; k < pairs.near()[list].size(); ++k) {
                known[list].insert(in_order(list, pairs.near()[list].vertices(k)));
            }
        }
        return known;
    }
    /// The number of pairs of both sheets.
    [[nodiscard]] std::size_t pairs_of_two() {
        std::size_t count = 0;
        for (const FeaturePairs& of : pairs.near()) {
            for (std::size_t k = 0; k < of.size(); ++k) {
                count += pairs.are_of_one_surface(of.vertices(k)) ? 0U : 1U;
            }
        }
        return count;
    }
    /// The numbers of pairs that are within the thickness there, and of those of them that are not known.
    struct Near {
        std::size_t all = 0;
        std::size_t unknown = 0;
    };
    [[nodiscard]] Near near(const std::vector<Row>& at) {
        const std::array<Known, 2> known = this->known();
        Near near;
        const auto take = [&](PairKind kind, const PairVertices& vertex) {
            const std::size_t list = list_of(kind);
            if (nearest_points(kind, positions_of(vertex, at.data())).distance < kOfPairs) {
                ++near.all;
                near.unknown += known[list].contains(in_order(list, vertex)) ? 0U : 1U;
            }
        };
        for (const std::uint32_t v : features_.vertices()) {
            for (const Triangle& t : features_.triangles()) {
                if (std::ranges::find(t, v) == t.end()) {
                    take(PairKind::VertexTriangle, {v, t[0], t[1], t[2]});
                }
            }
        }
        for (const auto& e : features_.edges()) {
            for (const auto& f : features_.edges()) {
                if (e < f && e[0] != f[0] && e[0] != f[1] && e[1] != f[0] && e[1] != f[1]) {
                    take(PairKind::EdgeEdge, {e[0], e[1], f[0], f[1]});
                }
            }
        }
        return near;
    }

  private:
    static PairVertices in_order(std::size_t list, PairVertices vertex) {
        if (list == 0) {
            std::ranges::sort(vertex.begin() + 1, vertex.end());
            return vertex;
        }
        std::ranges::sort(vertex.begin(), vertex.begin() + 2);
        std::ranges::sort(vertex.begin() + 2, vertex.end());
        if (vertex[2] < vertex[0]) {
            std::swap(vertex[0], vertex[2]);
            std::swap(vertex[1], vertex[3]);
        }
        return vertex;
    }

    std::array<TriangleMesh, 2> mesh_;
    std::array<ParticleSurface, 2> surfaces_;
    SurfaceFeatures features_;

  public:
    ParticleModel model;
    SheetPairs pairs;
};

class OfSteps : public testing::TestWithParam<double> {};

TEST_P(OfSteps, AllThatComeWithinTheThicknessAreKnown) {
    TwoSheets sheets;
    std::size_t near = 0;
    const double step = GetParam();
    const int steps = static_cast<int>(1.0 / step);
    for (int k = 0; k < steps; ++k) {
        const std::vector<Row> end = sheets.places(step * (k + 1));
        sheets.pairs.begin(sheets.model);
        ASSERT_TRUE(sheets.pairs.know(end.data()));
        if (k % (steps / 50) == 0) {
            for (const auto& at : {sheets.pairs.start(), end}) {
                const auto of = sheets.near(at);
                ASSERT_EQ(of.unknown, 0U) << "step " << k;
                near += of.all;
            }
            sheets.expect_gaps_at_start();
        }
        sheets.end(end);
        sheets.move_to(end);
    }
    EXPECT_GT(near, 200U);
    if (step < 0.005) {
        // Paths last for some sub-steps, and pairs with them.
        EXPECT_LT(sheets.pairs.counts().searches, static_cast<std::uint64_t>(steps));
    }
}

INSTANTIATE_TEST_SUITE_P(Lengths, OfSteps, testing::Values(0.001, 0.004, 0.02));

TEST(SheetPairs, AreFoundAgainWhereARoundLeadsVerticesElsewhere) {
    TwoSheets sheets;
    std::vector<Row> end = sheets.places(0.002);
    sheets.pairs.begin(sheets.model);
    ASSERT_TRUE(sheets.pairs.know(end.data()));
    EXPECT_FALSE(sheets.pairs.know_again(end.data()));
    // A corner folds over to the opposite one.
    end[0] = row_of(sheets.model.position[kAlongSide * kAlongSide - 1] + Vec3(0.001, 0.002, 0.0));
    EXPECT_TRUE(sheets.pairs.know_again(end.data()));
    const auto near = sheets.near(end);
    EXPECT_GT(near.all, 0U);
    EXPECT_EQ(near.unknown, 0U);
}

TEST(SheetPairs, OfTwoBodiesAreLeftOutWhereTheyDoNotCollide) {
    TwoSheets sheets(false);
    const std::vector<Row> end = sheets.places(0.01);
    sheets.pairs.begin(sheets.model);
    ASSERT_TRUE(sheets.pairs.know(end.data()));
    TwoSheets colliding;
    colliding.pairs.begin(colliding.model);
    ASSERT_TRUE(colliding.pairs.know(end.data()));
    EXPECT_EQ(sheets.pairs_of_two(), 0U);
    EXPECT_GT(colliding.pairs_of_two(), 0U);
}

TEST(SheetPairs, AreNotSoughtOnceTheStateHasDiverged) {
    TwoSheets sheets;
    std::vector<Row> end = sheets.places(0.01);
    end[5] = row_of(Vec3(1e13, 0.0, 0.0));
    sheets.pairs.begin(sheets.model);
    EXPECT_FALSE(sheets.pairs.know(end.data()));
}

TEST(SheetPairs, KnowWhereASubStepGoesOn) {
    TwoSheets sheets;
    const std::vector<Row> end = sheets.places(0.01);
    EXPECT_FALSE(sheets.pairs.begin(sheets.model));
    ASSERT_TRUE(sheets.pairs.know(end.data()));
    sheets.pairs.end(end.data());
    sheets.move_to(end);
    EXPECT_TRUE(sheets.pairs.begin(sheets.model));
    sheets.pairs.end(end.data());
    sheets.model.position[3].x += 1e-6;  // someone has moved it
    EXPECT_FALSE(sheets.pairs.begin(sheets.model));
}

TEST(SheetPairs, LeaveAloneWhereTwoSheetsTouchAtRest) {
    // The second one begins where the first one ends.
    const TriangleMesh first = sheet_at(0.0);
    TriangleMesh second = first;
    double side = 0.0;
    for (const Vec3& x : first.vertices) {
        side = std::max(side, 2.0 * x.x);
    }
    for (Vec3& x : second.vertices) {
        x.x += side;
    }
    const auto count = static_cast<std::uint32_t>(first.vertices.size());
    const std::vector<ParticleSurface> surfaces{
        {.first_particle = 0, .triangles = first.triangles, .rest = first.vertices},
        {.first_particle = count, .triangles = second.triangles, .rest = second.vertices}};
    SurfaceFeatures features(surfaces, collider_kernels(kWidestLanes));
    const SheetPairs pairs(features, 2UL * count, surfaces, {.thickness = kOfPairs, .least_gap = kGapOfPairs},
                           kWidestLanes);
    std::size_t left_alone = 0;
    for (std::uint32_t v = 0; v < 2 * count; ++v) {
        const double x = v < count ? first.vertices[v].x : second.vertices[v - count].x;
        const bool touches = std::abs(x - 0.5 * side) < 1e-9;
        // With it the corners of its triangles.
        const bool is_beside = std::abs(x - 0.5 * side) < 1.01 * side / (kAlongSide - 1);
        EXPECT_TRUE(!touches || pairs.leaves_alone(v, true)) << v;
        EXPECT_TRUE(is_beside || !pairs.leaves_alone(v, true)) << v;
        EXPECT_FALSE(pairs.leaves_alone(v, false)) << v << ": its sheet is still kept from itself";
        left_alone += pairs.leaves_alone(v, true) ? 1U : 0U;
    }
    EXPECT_GE(left_alone, 2 * kAlongSide);
}

}  // namespace
}  // namespace haptic::sim
