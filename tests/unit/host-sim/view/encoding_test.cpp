#include "view/encoding.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "decoded.hpp"
#include "small_scene.hpp"
#include "view/viewer.hpp"

namespace haptic::sim::view {
namespace {

using Json = nlohmann::json;
using test::Frame;
using test::Part;
using test::read_frame;
using test::read_surface;
using test::Reader;
using test::Surface;

constexpr double kDegree = 3.14159265358979323846 / 180.0;

/// A triangulated sphere around `centre`, whose normals are known.
struct Ball {
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;
};
Ball ball(const Vec3& centre, double radius, std::uint32_t rings) {
    Ball result;
    const std::uint32_t around = 2 * rings;
    for (std::uint32_t i = 0; i <= rings; ++i) {
        const double polar = 180.0 * kDegree * i / rings;
        for (std::uint32_t j = 0; j < around; ++j) {
            const double turn = 360.0 * kDegree * j / around;
            result.vertices.push_back(centre + radius * Vec3(std::sin(polar) * std::cos(turn), std::cos(polar),
                                                             -std::sin(polar) * std::sin(turn)));
            if (i < rings) {
                const std::uint32_t a = i * around + j;
                const std::uint32_t b = i * around + (j + 1) % around;
                result.triangles.push_back({a, a + around, b});
                result.triangles.push_back({b, a + around, b + around});
            }
        }
    }
    return result;
}

SceneDescription one_body(const Ball& body) {
    SceneDescription scene;
    scene.bodies = {{"ball", 0, body.vertices.size(), body.triangles, 0, 0}};
    return scene;
}

/// The frame sent to a new viewer that subscribes to everything.
Frame whole_frame(const EncodedSnapshot& snapshot) {
    Viewer viewer(false);
    ViewState state;
    state.scene = 3;
    (void)viewer.on_message(R"({"type":"watch","particles":true,"planes":true})", {}, 1);
    state.snapshot = &snapshot;
    state.snapshots = 1;
    Outgoing message;
    while (viewer.compose(state, 1, message) && (message.text || message.bytes.empty())) {
    }
    return read_frame(message.bytes);
}

TEST(Encoding, KeepsPositionsToTheResolutionOfTheBox) {
    std::mt19937 random(7);  // NOLINT(bugprone-random-generator-seed)
    std::normal_distribution<double> spread;
    for (const double size : {1e-3, 1.0, 1e3}) {
        for (const double away : {0.0, 1.0, 1e4}) {
            Ball body;
            for (int k = 0; k < 500; ++k) {
                body.vertices.push_back(Vec3(away) +
                                        size * Vec3{spread(random), spread(random), 0.01 * spread(random)});
            }
            SceneSnapshot snapshot;
            snapshot.vertices = body.vertices;
            SnapshotEncoder encoder(one_body(body));
            encoder.encode(snapshot, false, 1);
            const Frame frame = whole_frame(encoder.encoded());
            ASSERT_NE(frame.part(1), nullptr);
            const Surface surface = read_surface(*frame.part(1));
            ASSERT_EQ(surface.positions.size(), body.vertices.size());
            for (std::size_t v = 0; v < body.vertices.size(); ++v) {
                for (int axis = 0; axis < 3; ++axis) {
                    // Half a quantization step.
                    const double bound = 0.5001 * surface.size[axis] / 65535.0;
                    EXPECT_LE(std::abs(surface.positions[v][axis] - body.vertices[v][axis]), bound);
                }
            }
        }
    }
}

TEST(Encoding, FitsTheBoxToTheBody) {
    const Ball body = ball({1.0, 2.0, 3.0}, 0.5, 12);
    SceneSnapshot snapshot;
    snapshot.vertices = body.vertices;
    SnapshotEncoder encoder(one_body(body));
    encoder.encode(snapshot, false, 1);
    const Frame frame = whole_frame(encoder.encoded());
    const Surface surface = read_surface(*frame.part(1));
    for (int axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(surface.size[axis], 1.0, 1e-6);
    }
}

TEST(Encoding, KeepsNormalsToADegree) {
    const Ball body = ball(Vec3(0.0), 1.0, 90);
    SceneSnapshot snapshot;
    snapshot.vertices = body.vertices;
    SnapshotEncoder encoder(one_body(body));
    encoder.encode(snapshot, false, 1);
    const Frame frame = whole_frame(encoder.encoded());
    const Surface surface = read_surface(*frame.part(1));
    double worst = 0.0;
    for (std::size_t v = 180; v + 180 < body.vertices.size(); ++v) {  // at the poles triangles are degenerate
        worst = std::max(worst, std::acos(std::min(1.0, glm::dot(surface.normals[v], body.vertices[v]))));
    }
    EXPECT_LT(worst, 1.0 * kDegree);
    EXPECT_GT(worst, 0.1 * kDegree);  // 8 bits cannot be better: what is compared is what was sent
}

TEST(Encoding, EncodesAndDecodesEveryDirection) {
    std::mt19937 random(11);  // NOLINT(bugprone-random-generator-seed)
    std::normal_distribution<double> spread;
    std::vector<Vec3> directions = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}, {1, 0, -1e-9}};
    for (int k = 0; k < 20'000; ++k) {
        directions.emplace_back(spread(random), spread(random), spread(random));
    }
    for (const Vec3& direction : directions) {
        const auto [u, v] = octahedral(direction);
        const double cosine = glm::dot(test::from_octahedral(u / 127.0, v / 127.0), glm::normalize(direction));
        ASSERT_GT(cosine, std::cos(1.0 * kDegree)) << direction.x << " " << direction.y << " " << direction.z;
    }
}

TEST(Encoding, EncodesNonFiniteValuesAsNumbers) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    constexpr double infinity = std::numeric_limits<double>::infinity();
    Ball body = ball(Vec3(0.0), 1.0, 6);
    body.vertices[3] = {nan, 0.0, 0.0};
    body.vertices[5] = {0.0, infinity, 0.0};
    SceneSnapshot snapshot;
    snapshot.vertices = body.vertices;
    SnapshotEncoder encoder(one_body(body));
    encoder.encode(snapshot, false, 1);
    const Frame frame = whole_frame(encoder.encoded());
    const Surface surface = read_surface(*frame.part(1));
    for (std::size_t v = 0; v < body.vertices.size(); ++v) {
        EXPECT_LE(glm::length(surface.positions[v]), 2.0);
        if (v != 3 && v != 5) {
            EXPECT_LT(glm::distance(surface.positions[v], body.vertices[v]), 1e-4);
        }
    }
    EXPECT_EQ(octahedral(Vec3(0.0)), (std::array<std::int8_t, 2>{0, 0}));
    EXPECT_EQ(octahedral(Vec3(nan, 0.0, 1.0)), (std::array<std::int8_t, 2>{0, 0}));
}

TEST(Encoding, DropsBackFacesSoThatNormalsDoNotCancel) {
    const SceneDescription scene = test::small_description();
    EXPECT_EQ(single_faces(scene.bodies[0].triangles), (std::vector<Triangle>{{0, 1, 2}, {1, 3, 2}}));
    SnapshotEncoder encoder(scene);
    encoder.encode(test::small_snapshot(), false, 1);
    const Frame frame = whole_frame(encoder.encoded());
    const Vec3 normal = read_surface(*frame.part(1)).normals[0];
    EXPECT_LT(normal.y, -std::cos(1.0 * kDegree));  // (b - a) x (c - a) of the first triangle: x times z is -y
}

TEST(Encoding, GivesOnlyChangedPartsANewVersion) {
    const SceneDescription scene = test::small_description();
    SceneSnapshot snapshot = test::small_snapshot();
    SnapshotEncoder encoder(scene);
    encoder.encode(snapshot, true, 1);
    const auto versions = [&] {
        std::vector<std::uint64_t> all;
        for (const EncodedPart& part : encoder.encoded().surfaces) {
            all.push_back(part.version);
        }
        for (const EncodedPart& part : encoder.encoded().particles) {
            all.push_back(part.version);
        }
        return all;
    };
    EXPECT_EQ(versions(), (std::vector<std::uint64_t>{1, 1, 1, 1, 1}));
    encoder.encode(snapshot, true, 1);
    EXPECT_EQ(versions(), (std::vector<std::uint64_t>{1, 1, 1, 1, 1}));
    snapshot.vertices[7].x += 1e-9;  // of the second body
    encoder.encode(snapshot, true, 1);
    EXPECT_EQ(versions(), (std::vector<std::uint64_t>{1, 2, 1, 1, 1}));
    snapshot.tool_vertices[2].z += 0.1;
    snapshot.orientations[0] = Quat(0.0, 1.0, 0.0, 0.0);
    encoder.encode(snapshot, true, 1);
    EXPECT_EQ(versions(), (std::vector<std::uint64_t>{1, 2, 2, 2, 1}));
    snapshot.particles[2].x += 0.1;
    encoder.encode(snapshot, false, 1);  // nobody is subscribed
    EXPECT_EQ(versions(), (std::vector<std::uint64_t>{1, 2, 2, 2, 1}));
    encoder.encode(snapshot, true, 1);
    EXPECT_EQ(versions(), (std::vector<std::uint64_t>{1, 2, 2, 2, 2}));
}

TEST(Encoding, SendsParticlesProxiesPlanesHandAndParametersAsSpecified) {
    SceneSnapshot snapshot = test::small_snapshot();
    snapshot.time = 1.25;
    snapshot.step = 125;
    snapshot.in_contact = true;
    snapshot.run.paused = true;
    snapshot.run.diverged = true;
    snapshot.orientations[2] = Quat(0.6, 0.0, -0.8, 0.0);
    snapshot.tool = {{1.0, 2.0, 3.0}, {0.5, 0.5, 0.5, 0.5}};
    snapshot.hip = {{4.0, 5.0, 6.0}, {1.0, 0.0, 0.0, 0.0}};
    snapshot.force = {7.0, 8.0, 9.0};
    snapshot.hand_torque = {10.0, 11.0, 12.0};
    snapshot.curl = 0.25;
    snapshot.depth = 0.125;
    snapshot.run.hand = HandSource::Mouse;
    snapshot.run.late_steps = 3;
    snapshot.run.recorded_steps = 1000;
    snapshot.forces = {{.point = {0.5, 0.25, 0.75}, .force = 1.5, .body = 1}};
    SnapshotEncoder encoder(test::small_description());
    encoder.encode(snapshot, true, 2);
    const Frame frame = whole_frame(encoder.encoded());
    EXPECT_EQ(frame.scene, 3U);
    EXPECT_EQ(frame.time, 1.25);
    EXPECT_EQ(frame.step, 125.0);
    EXPECT_EQ(frame.flags, 1U + 4U + 16U);
    EXPECT_EQ(frame.parts.size(), 2U + 1U + 2U + 5U);

    ASSERT_NE(frame.part(3, 1), nullptr);
    Reader particles(frame.part(3, 1)->bytes);
    EXPECT_EQ(particles.vec3(), Vec3(2.1F, 2.2F, 2.3F));
    EXPECT_NEAR(particles.take<std::int16_t>() / 32767.0, 0.6, 0.5 / 32767.0);
    EXPECT_EQ(particles.take<std::int16_t>(), 0);
    EXPECT_NEAR(particles.take<std::int16_t>() / 32767.0, -0.8, 0.5 / 32767.0);

    ASSERT_NE(frame.part(4), nullptr);
    EXPECT_EQ(frame.part(4)->count, 2U);
    Reader proxies(frame.part(4)->bytes);
    EXPECT_EQ(proxies.vec3(), Vec3(0.5, 1.0, 0.5));
    EXPECT_EQ(proxies.vec3(), Vec3(0.5, 0.9F, 0.5));
    EXPECT_EQ(proxies.u32(), 1U);
    EXPECT_EQ(proxies.f32(), 0.05F);
    (void)proxies.skip(24);
    EXPECT_EQ(proxies.u32(), 2U);

    ASSERT_NE(frame.part(5), nullptr);
    Reader planes(frame.part(5)->bytes);
    EXPECT_EQ(planes.vec3(), Vec3(0.0, 1.0, 0.0));
    EXPECT_EQ(planes.f32(), 0.25F);
    EXPECT_EQ(planes.f32(), -0.5F);
    EXPECT_EQ(planes.u32(), 1U);
    EXPECT_EQ(planes.u32(), 1U);
    EXPECT_TRUE(planes.at_end());

    ASSERT_NE(frame.part(6), nullptr);
    Reader hand(frame.part(6)->bytes);
    std::vector<float> numbers;
    while (!hand.at_end()) {
        numbers.push_back(hand.f32());
    }
    EXPECT_THAT(numbers, testing::ElementsAre(1, 2, 3, 0.5, 0.5, 0.5, 0.5, 4, 5, 6, 1, 0, 0, 0, 7, 8, 9, 0, 0, 0, 0, 0,
                                              0, 10, 11, 12, 0.25, 0.125, 0, 0, 2, 3, 1000, 2));

    ASSERT_NE(frame.part(7), nullptr);
    EXPECT_EQ(frame.part(7)->count, 3U);
    Reader parameters(frame.part(7)->bytes);
    EXPECT_EQ(parameters.f32(), 20.0F);
    EXPECT_EQ(parameters.f32(), 5.0F);
    EXPECT_EQ(parameters.f32(), 1.0F);

    ASSERT_NE(frame.part(8), nullptr);
    EXPECT_EQ(frame.part(8)->count, 1U);
    Reader contacts(frame.part(8)->bytes);
    EXPECT_EQ(contacts.vec3(), Vec3(0.5, 0.25, 0.75));
    EXPECT_EQ(contacts.f32(), 1.5F);
    EXPECT_EQ(contacts.u32(), 1U);
    EXPECT_TRUE(contacts.at_end());
}

TEST(Encoding, DescribesTheScene) {
    const Json scene = Json::parse(scene_message(test::small_description(), 5, true));
    EXPECT_EQ(scene.at("type"), "scene");
    EXPECT_EQ(scene.at("protocol"), 1);
    EXPECT_EQ(scene.at("scene"), 5);
    EXPECT_EQ(scene.at("text"), "Two bodies \xE2\x80\x93 and a tool");
    EXPECT_EQ(scene.at("scenes"), Json({"small", "other"}));
    EXPECT_EQ(scene.at("control"), true);
    EXPECT_EQ(scene.at("mode"), "run");
    EXPECT_EQ(scene.at("ground"), -1.5);
    EXPECT_EQ(scene.at("bodies").at(0),
              Json({{"name", "sheet"}, {"vertices", 4}, {"triangles", 2}, {"first_particle", 0}, {"particles", 2}}));
    EXPECT_EQ(scene.at("tool"), Json({{"vertices", 3}, {"triangles", 1}, {"radii", {0.05, 0.06}}}));
    EXPECT_EQ(scene.at("groups"), 2);
    EXPECT_EQ(scene.at("links"), 1);
    EXPECT_EQ(scene.at("parameters").at(2).at("choices"), Json({"complete", "thesis"}));
    EXPECT_EQ(scene.at("parameters").at(0).at("most"), 100.0);
    EXPECT_EQ(scene.at("parameters").at(0).at("meaning"), "Hand to tool.");
    SceneDescription recording;
    recording.length = 4.0;
    recording.name = "not UTF-8: \xff";
    EXPECT_EQ(Json::parse(scene_message(recording, 1, false)).at("mode"), "play");
    EXPECT_TRUE(Json::parse(scene_message(recording, 1, false)).at("ground").is_null());
}

TEST(Encoding, SendsTheGeometryInTheOrderOfTheProtocol) {
    const SceneDescription scene = test::small_description();
    const Bytes message = geometry_message(scene, 5);
    Reader reader(message);
    EXPECT_EQ(reader.u32(), 1U);
    EXPECT_EQ(reader.u32(), 5U);
    const auto triangle = [&] {
        const std::uint32_t a = reader.u32();
        const std::uint32_t b = reader.u32();
        return Triangle{a, b, reader.u32()};
    };
    EXPECT_EQ(triangle(), (Triangle{0, 1, 2}));
    EXPECT_EQ(triangle(), (Triangle{1, 3, 2}));
    for (const Triangle& expected : scene.bodies[1].triangles) {
        EXPECT_EQ(triangle(), expected);
    }
    EXPECT_EQ(triangle(), (Triangle{0, 1, 2}));
    EXPECT_EQ(reader.vec3(), Vec3(0.1F));
    EXPECT_EQ(reader.vec3(), Vec3(0.1F, 0.2F, 0.3F));
    EXPECT_EQ(reader.vec3(), Vec3(0.0));
    for (int k = 0; k < 3; ++k) {
        EXPECT_EQ(reader.f32(), 1.0F);
        EXPECT_EQ(reader.vec3(), Vec3(0.0));
    }
    for (const std::uint32_t number : {0U, 2U, 0U, 1U, 2U, 1U, 2U, 0U, 1U}) {  // groups, then the link
        EXPECT_EQ(reader.u32(), number);
    }
    EXPECT_TRUE(reader.at_end());
}

TEST(Encoding, SendsSamplesWithTheTimeSinceTheFirst) {
    const std::vector<StepSample> samples = {{1000.25, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}, {1000.5, 12}};
    const Bytes message = samples_message(samples, 5, 17);
    Reader reader(message);
    EXPECT_EQ(reader.u32(), 3U);
    EXPECT_EQ(reader.u32(), 5U);
    EXPECT_EQ(reader.take<double>(), 1000.25);
    EXPECT_EQ(reader.u32(), 2U);
    EXPECT_EQ(reader.u32(), 17U);
    for (int k = 0; k < 12; ++k) {
        EXPECT_EQ(reader.f32(), static_cast<float>(k));
    }
    EXPECT_EQ(reader.f32(), 0.25F);
    EXPECT_EQ(reader.f32(), 12.0F);
    (void)reader.skip(40);
    EXPECT_TRUE(reader.at_end());
}

}  // namespace
}  // namespace haptic::sim::view
