// Fuzz target: messages of a page. The result is a command within the bounds of command.hpp, a refusal with a reason,
// or "not of the protocol". Nothing is thrown.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <variant>

#include "haptic/types.hpp"
#include "require.hpp"
#include "view/command_parser.hpp"

namespace {

using namespace haptic::sim::view;

constexpr std::size_t kLongestReason = 120;  // fits in a close frame

SceneDescription description() {
    SceneDescription scene;
    scene.scenes = {"small", "other"};
    scene.length = 10.0;
    scene.parameters = {{"coupling.stiffness", "", "", 0.0, 100.0, false, true, {}, ""},
                        {"solver.iterations", "", "", 1.0, 20.0, true, false, {}, ""},
                        {"contact.method", "", "", 0.0, 0.0, true, false, {"complete", "thesis"}, ""}};
    return scene;
}

struct Bounds {
    const SceneDescription& scene;

    void operator()(const SetParameter& set) const {
        require(set.parameter < scene.parameters.size(), "the parameter is one of the scene's");
        const ParameterDescription& parameter = scene.parameters[set.parameter];
        const bool chosen = !parameter.choices.empty();
        const double max = chosen ? static_cast<double>(parameter.choices.size()) - 1.0 : parameter.max;
        require(set.value >= (chosen ? 0.0 : parameter.min) && set.value <= max, "a value is within its range");
        require(!(chosen || parameter.whole) || set.value == std::floor(set.value), "a whole number is whole");
    }
    void operator()(const SingleStep& step) const { require(step.steps >= 1 && step.steps <= 1000, "steps are few"); }
    void operator()(const ChangeScene& change) const {
        require(change.name == "small" || change.name == "other", "the scene is one of those listed");
    }
    void operator()(const MoveHand& move) const {
        for (const double coordinate : {move.position.x, move.position.y, move.position.z}) {
            require(std::abs(coordinate) <= kMaxHandCoordinate, "the hand is not far");
        }
        if (move.orientation) {
            const haptic::Quat& q = *move.orientation;
            const double length = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
            require(std::abs(length - 1.0) < 1e-12, "the orientation is a rotation");
        }
        require(!move.curl || (*move.curl >= 0.0 && *move.curl <= 1.0), "a hand closes between open and closed");
    }
    void operator()(const Seek& seek) const { require(seek.time >= 0.0 && seek.time <= scene.length, "time is there"); }
    void operator()(const SetSpeed& set) const { require(set.speed >= 0.01 && set.speed <= 10.0, "speed is bounded"); }
    template <class Other>
    void operator()(const Other& /*command*/) const {}
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const SceneDescription scene = description();
    const Request request = parse_request({reinterpret_cast<const char*>(data), size}, scene);
    if (const auto* command = std::get_if<Command>(&request)) {
        std::visit(Bounds{scene}, *command);
        require(!type_of(*command).empty(), "a command has a name");
    } else if (const auto* refusal = std::get_if<Refusal>(&request)) {
        require(!refusal->why.empty() && refused_message(*refusal).size() < kMaxRequestBytes, "a refusal says why");
    } else if (const auto* malformed = std::get_if<Malformed>(&request)) {
        require(!malformed->why.empty() && malformed->why.size() <= kLongestReason, "the end has a reason");
    }
    return 0;
}
