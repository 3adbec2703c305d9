// Zones of impact: what they do to the motion of their vertices.
#include "collision/impact_zones.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/geometric.hpp>
#include <numeric>
#include <random>
#include <vector>

#include "collision/vertex_masses.hpp"
#include "dynamics/rows.hpp"
#include "haptic/sim/particles.hpp"

namespace haptic::sim {
namespace {

constexpr std::size_t kVertices = 12;
constexpr double kPlaces = 1e-15;  // m: some roundings of places
constexpr PairVertices kFirst{0, 1, 2, 3};
constexpr PairVertices kNext{3, 4, 5, 6};  // meets the first one
constexpr PairVertices kOther{8, 9, 10, 11};

/// Vertices that ask for ways of their own. The last four are of another surface.
class Zones : public testing::Test {
  protected:
    Zones() : surface_of_(kVertices, 0), all_(kVertices) {
        std::mt19937 random(3);
        std::uniform_real_distribution<double> number(-1.0, 1.0);
        const auto vector = [&](double scale) {
            const double x = number(random);
            const double y = number(random);
            return scale * Vec3(x, y, number(random));
        };
        std::iota(all_.begin(), all_.end(), 0U);
        for (std::size_t v = 0; v < kVertices; ++v) {
            surface_of_[v] = v < 8 ? 0 : 1;
            model_.add(vector(0.02), 0.001 * (1.5 + number(random)), 0.001);
            start_.push_back(row_of(model_.position[v]));
            wish_.push_back(row_of(model_.position[v] + vector(0.002)));
        }
    }
    /// Where zones lead that `make` has made.
    std::vector<Row> led(const std::function<void(ImpactZones&)>& make, bool turning = true) {
        const VertexMasses masses(model_);
        ImpactZones zones(all_, surface_of_, masses);
        make(zones);
        std::vector<Row> end = wish_;
        zones.move(start_.data(), wish_.data(), turning, end.data());
        return end;
    }
    [[nodiscard]] Vec3 start(std::size_t v) const { return vector_of(start_[v]); }
    [[nodiscard]] Vec3 way(std::size_t v, const std::vector<Row>& to) const { return vector_of(to[v]) - start(v); }
    struct Sums {
        Vec3 linear{0.0};     // kg m
        Vec3 angular{0.0};    // kg m^2, about the origin
        double square = 0.0;  // kg m^2
    };
    [[nodiscard]] Sums sums(const std::vector<Row>& to) const {
        Sums sums;
        for (std::size_t v = 0; v < kVertices; ++v) {
            const Vec3 momentum = model_.mass[v] * way(v, to);
            sums.linear += momentum;
            sums.angular += glm::cross(start(v), momentum);
            sums.square += glm::dot(momentum, way(v, to));
        }
        return sums;
    }

    ParticleModel model_;
    std::vector<std::uint32_t> surface_of_;
    std::vector<std::uint32_t> all_;
    std::vector<Row> start_;
    std::vector<Row> wish_;
};

TEST_F(Zones, KeepMomentaAndTakeEnergyOut) {
    const Sums asked = sums(wish_);
    double less_than = asked.square;
    for (const double part : {0.5, 0.1, 0.0}) {
        const Sums led_by = sums(led([&](ImpactZones& zones) {
            zones.unite(kFirst, part);
            zones.unite(kNext, 1.0);
            zones.unite(kOther, part);
        }));
        EXPECT_LT(glm::length(led_by.linear - asked.linear), 1e-18) << part;
        EXPECT_LT(glm::length(led_by.angular - asked.angular), 1e-19) << part;
        EXPECT_LT(led_by.square, less_than) << part;
        less_than = led_by.square;
    }
}

TEST_F(Zones, ThatAreRigidBringNoVerticesNearer) {
    const std::vector<Row> end = led([](ImpactZones& zones) {
        zones.unite(kFirst, 0.0);
        zones.unite(kNext, 1.0);  // one zone with the first, and as rigid
    });
    bool turned = false;
    for (std::size_t a = 0; a < 7; ++a) {
        for (std::size_t b = 0; b < a; ++b) {
            const double before = glm::length(start(a) - start(b));
            for (const double s : {0.25, 0.5, 1.0}) {
                EXPECT_GE(glm::length(start(a) + s * way(a, end) - start(b) - s * way(b, end)), before - 1e-15);
            }
            turned = turned || glm::length(way(a, end) - way(b, end)) > 1e-5;
        }
    }
    EXPECT_TRUE(turned);
    // Others go where they wish.
    for (std::size_t v = 7; v < kVertices; ++v) {
        EXPECT_EQ(way(v, end), way(v, wish_));
    }
}

TEST_F(Zones, KeepTheLeastPartOfWhatTheyAreMadeOf) {
    // A zone keeps half of its inner motion and one a quarter. Together they keep half of the lesser part.
    const std::vector<Row> end = led([](ImpactZones& zones) {
        zones.unite(kFirst, 0.5);
        zones.unite(PairVertices{4, 5, 6, 7}, 0.25);
        zones.unite(kNext, 0.5);
    });
    const std::vector<Row> rigid = led([](ImpactZones& zones) {
        zones.unite(kFirst, 0.0);
        zones.unite(PairVertices{4, 5, 6, 7}, 0.0);
        zones.unite(kNext, 0.0);
    });
    for (std::size_t v = 0; v < 8; ++v) {
        const Vec3 inner = way(v, wish_) - way(v, rigid);
        EXPECT_LT(glm::length(way(v, end) - way(v, rigid) - 0.125 * inner), kPlaces) << v;
    }
}

TEST_F(Zones, AreHeldByTheGround) {
    const std::vector<Row> end = led([](ImpactZones& zones) {
        zones.ground(4, 0.5);
        zones.unite(kFirst, 0.0);
        zones.unite(kNext, 1.0);
    });
    for (std::size_t v = 0; v < 7; ++v) {
        EXPECT_EQ(way(v, end), Vec3(0.0)) << v;
    }
}

TEST_F(Zones, GoWithWhatIsPinnedIfThatMovesAlike) {
    const auto make = [](ImpactZones& zones) { zones.unite(kFirst, 0.0); };
    model_.pinned[1] = model_.pinned[2] = 1;
    const Vec3 led_by(0.001, 0.002, -0.001);
    for (const std::size_t v : {std::size_t{1}, std::size_t{2}}) {
        wish_[v] = row_of(start(v) + led_by);
    }
    ASSERT_NE(way(1, wish_), way(2, wish_));  // but for their rounding
    for (std::size_t v = 0; v < 4; ++v) {
        EXPECT_LT(glm::length(way(v, led(make)) - led_by), kPlaces) << v;
    }
    // Two pins that part hold it.
    wish_[2] = row_of(start(2) + led_by + Vec3(1e-9, 0.0, 0.0));
    for (std::size_t v = 0; v < 4; ++v) {
        EXPECT_EQ(way(v, led(make)), Vec3(0.0)) << v;
    }
}

TEST_F(Zones, OfAllMoveAlikeWithoutTurningOrStandOnTheGround) {
    const Sums asked = sums(wish_);
    const double mass = std::accumulate(model_.mass.begin(), model_.mass.end(), 0.0);
    const std::vector<Row> end = led([](ImpactZones& zones) { zones.unite_all(false); }, false);
    const std::vector<Row> stands = led([](ImpactZones& zones) { zones.unite_all(true); }, false);
    for (std::size_t v = 0; v < kVertices; ++v) {
        EXPECT_LT(glm::length(way(v, end) - asked.linear / mass), kPlaces) << v;
        EXPECT_EQ(way(v, stands), Vec3(0.0)) << v;
    }
}

TEST_F(Zones, KnowWhoMovesRigidlyAndWhoIsMixed) {
    const VertexMasses masses(model_);
    ImpactZones zones(all_, surface_of_, masses);
    zones.unite(kFirst, 0.0);
    zones.unite(kOther, 0.5);
    EXPECT_FALSE(zones.are_rigid(kFirst));  // not yet known
    zones.find_rigid();
    EXPECT_TRUE(zones.are_rigid(kFirst));
    EXPECT_FALSE(zones.are_rigid(kNext));   // of two zones
    EXPECT_FALSE(zones.are_rigid(kOther));  // half of its inner motion is left
    EXPECT_TRUE(zones.contain(0) && zones.contain(8));
    EXPECT_FALSE(zones.contain(7));
    std::vector<Row> end = wish_;
    zones.move(start_.data(), wish_.data(), true, end.data());
    EXPECT_FALSE(zones.are_mixed(0));
    zones.unite(PairVertices{0, 1, 8, 9}, 1.0);
    zones.move(start_.data(), wish_.data(), true, end.data());
    EXPECT_TRUE(zones.are_mixed(0) && zones.are_mixed(11));
    zones.clear();
    EXPECT_FALSE(zones.contain(0) || zones.are_rigid(kFirst));
}

}  // namespace
}  // namespace haptic::sim
