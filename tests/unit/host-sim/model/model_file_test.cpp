#include "model/model_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/sim/fish.hpp"
#include "haptic/sim/model_settings.hpp"

namespace haptic::sim {
namespace {

/// A fish with few particles and every feature that a file can have.
const DeformableBody& fish_with_everything() {
    static const DeformableBody made = [] {
        DeformableBody body = build_body(make_fish_mesh({}), {.particles = 30, .neighbours = 5, .link_stiffness = 0.3});
        body.name = "fish";
        body.particles.pinned[3] = body.particles.pinned[7] = 1;
        body.particles.groups[4].stiffness = 0.1;
        body.particles.groups[5].compliance = 1e-5 / 3.0;
        body.particles.links[2].compliance = 1.0 / 7.0;
        body.motions.push_back({{3, 7}, {0.0, 0.1, 1.0 / 3.0}, {Vec3(0.0), Vec3(0.1, 1e-17, -2.0), Vec3(0.0)}, true});
        return body;
    }();
    return made;
}

DeformableBody read_body(const std::string& toml) {
    return read_model_file(Config::parse(toml, "model.toml"), fish_with_everything().mesh, 0.0);
}

std::string replaced(std::string text, std::string_view from, std::string_view to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

std::string file_refusal(const std::string& toml) {
    try {
        (void)read_body(toml);
    } catch (const ConfigError& error) {
        return error.what();
    }
    return "";
}

TEST(ModelFile, KeepsEveryBit) {
    const DeformableBody again = read_body(model_toml(fish_with_everything()));
    const ParticleModel& a = fish_with_everything().particles;
    const ParticleModel& b = again.particles;
    EXPECT_EQ(again.name, "fish");
    EXPECT_EQ(b.rest_position, a.rest_position);
    EXPECT_EQ(b.position, a.position);
    EXPECT_EQ(b.mass, a.mass);
    EXPECT_EQ(b.radius, a.radius);
    EXPECT_EQ(b.semi_axes, a.semi_axes);
    EXPECT_EQ(b.axes, a.axes);
    EXPECT_EQ(b.pinned, a.pinned);
    ASSERT_EQ(b.groups.size(), a.groups.size());
    for (std::size_t g = 0; g < a.groups.size(); ++g) {
        EXPECT_EQ(b.groups[g].centre, a.groups[g].centre);
        EXPECT_EQ(b.groups[g].members, a.groups[g].members);
        EXPECT_EQ(b.groups[g].stiffness, a.groups[g].stiffness);
        EXPECT_EQ(b.groups[g].compliance, a.groups[g].compliance);
    }
    ASSERT_EQ(b.links.size(), a.links.size());
    for (std::size_t l = 0; l < a.links.size(); ++l) {
        EXPECT_EQ(b.links[l].first, a.links[l].first);
        EXPECT_EQ(b.links[l].second, a.links[l].second);
        EXPECT_EQ(b.links[l].rest_length, a.links[l].rest_length);
        EXPECT_EQ(b.links[l].stiffness, a.links[l].stiffness);
        EXPECT_EQ(b.links[l].compliance, a.links[l].compliance);
    }
    ASSERT_EQ(again.motions.size(), 1u);
    EXPECT_EQ(again.motions[0].particles, fish_with_everything().motions[0].particles);
    EXPECT_EQ(again.motions[0].times, fish_with_everything().motions[0].times);
    EXPECT_EQ(again.motions[0].offsets, fish_with_everything().motions[0].offsets);
    EXPECT_TRUE(again.motions[0].repeat);
    ASSERT_EQ(again.skin.size(), fish_with_everything().skin.size());
    for (std::size_t j = 0; j < again.skin.size(); ++j) {
        EXPECT_EQ(again.skin[j].particle, fish_with_everything().skin[j].particle) << j;
        EXPECT_EQ(again.skin[j].weight, fish_with_everything().skin[j].weight) << j;
    }
    EXPECT_EQ(model_toml(again), model_toml(fish_with_everything()));
}

TEST(ModelFile, RebuildsTheSkinWhenAParticleWasMoved) {
    DeformableBody moved = fish_with_everything();
    moved.particles.rest_position[0] += Vec3(0.0, 0.0, 0.004);
    const DeformableBody again = read_body(model_toml(moved));
    EXPECT_NO_THROW(Skinner(again.mesh.vertices, again.particles, again.skin));
    bool changed = false;
    for (std::size_t j = 0; j < again.skin.size(); ++j) {
        changed = changed || again.skin[j].weight != fish_with_everything().skin[j].weight;
    }
    EXPECT_TRUE(changed);
}

TEST(ModelFile, NamesLineAndRemedyOfWhatIsWrong) {
    const std::string good = model_toml(fish_with_everything());
    const auto expect_refused = [](const std::string& toml, const std::string& key, const std::string& remedy) {
        const std::string what = file_refusal(toml);
        EXPECT_EQ(what.rfind("model.toml:", 0), 0u) << what;
        EXPECT_NE(what.find(key), std::string::npos) << what;
        EXPECT_NE(what.find(remedy), std::string::npos) << what;
    };
    expect_refused(replaced(good, "mass = ", "weight = "), "particle.0.mass", "missing");
    expect_refused(replaced(good, "mass = ", "mass = -"), "particle.0.mass", "within");
    expect_refused(replaced(good, "radius = ", "radios = 0\nradius = "), "particle.0.radios", "radius");
    expect_refused(replaced(good, "axes = [", "axes = [1.0, "), "axes", "numbers");
    expect_refused(replaced(good, "neighbours = [", "neighbours = [30, "), "particle.0.neighbours", "29");
    expect_refused(replaced(good, "neighbours = [", "neighbours = [0, "), "particle.0.neighbours", "itself");
    expect_refused(replaced(good, "neighbours = [", "neighbours = [1.5, "), "particle.0.neighbours", "indices");
    expect_refused(replaced(good, "particles = [3, 7]", "particles = [3, 8]"), "motion.0.particles", "fixed = true");
    expect_refused(replaced(good, "times = [0.0, 0.1", "times = [0.0, 0.0"), "motion.0.times", "increase");
    expect_refused("name = \"nothing\"\n", "particle", "[[particle]]");
}

TEST(ModelFile, ReplacesTheBuiltParticles) {
    const std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / ("model-file-test-" + std::to_string(getpid()) + ".toml");
    save_model(file, fish_with_everything());
    Config config;
    config.set("model.generator=fish");
    config.set("model.height=2.0");
    config.set("model.particles=\"" + file.string() + "\"");
    const std::vector<DeformableBody> bodies = make_bodies(read_model(config, "model"));
    std::filesystem::remove(file);
    ASSERT_EQ(bodies.size(), 1u);
    ASSERT_EQ(bodies[0].particles.size(), 30u);
    EXPECT_EQ(bodies[0].particles.rest_position[5],
              fish_with_everything().particles.rest_position[5] + Vec3(0.0, 2.0, 0.0));
    EXPECT_EQ(bodies[0].particles.pinned[7], 1);
    EXPECT_THROW(save_model("/no/such/folder/model.toml", fish_with_everything()), std::runtime_error);
}

}  // namespace
}  // namespace haptic::sim
