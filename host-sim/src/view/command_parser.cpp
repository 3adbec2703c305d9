#include "view/command_parser.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

namespace haptic::sim::view {
namespace {

using Json = nlohmann::json;

constexpr int kMostSteps = 1000;
constexpr double kSlowest = 0.01;  // simulated seconds a second
constexpr double kFastest = 10.0;

/// The members of a message, each of which has to be of its type. Throws Malformed and Refusal.
class Members {
  public:
    Members(const Json& message, std::string type) : message_(message), type_(std::move(type)) {}

    [[nodiscard]] const std::string& type() const noexcept { return type_; }

    /// A member that the message may not have is no slip of the pen: somebody means something that we do not know.
    void only(std::initializer_list<std::string_view> names) const {
        for (const auto& [name, value] : message_.items()) {
            if (name != "type" && std::find(names.begin(), names.end(), name) == names.end()) {
                throw Malformed{type_ + " has a member that it does not know"};
            }
        }
    }
    [[nodiscard]] bool has(const char* name) const { return message_.contains(name); }
    [[nodiscard]] bool boolean(const char* name) const { return member(name, &Json::is_boolean, "true or false"); }
    [[nodiscard]] double number(const char* name) const { return member(name, &Json::is_number, "a number"); }
    [[nodiscard]] std::string string(const char* name) const { return member(name, &Json::is_string, "a string"); }

    template <std::size_t kCount>
    [[nodiscard]] std::array<double, kCount> numbers(const char* name) const {
        const Json list = member(name, &Json::is_array, "a list of numbers");
        if (list.size() != kCount ||
            !std::all_of(list.begin(), list.end(), [](const Json& j) { return j.is_number(); })) {
            throw Malformed{type_ + ": " + name + " must be " + std::to_string(kCount) + " numbers"};
        }
        return list;
    }

    [[noreturn]] void refuse(const std::string& why) const { throw Refusal{type_, why}; }

  private:
    [[nodiscard]] const Json& member(const char* name, bool (Json::*is)() const noexcept, const char* what) const {
        const auto found = message_.find(name);
        if (found == message_.end() || !((*found).*is)()) {
            throw Malformed{type_ + ": " + name + " must be " + what};
        }
        return *found;
    }

    const Json& message_;
    std::string type_;
};

std::string written(double number) {
    return Json(number).dump();
}

Watch read_watch(const Members& members) {
    members.only({"particles", "planes", "samples"});
    const auto wants = [&](const char* name) { return members.has(name) && members.boolean(name); };
    return {wants("particles"), wants("planes"), wants("samples")};
}

SetParameter read_set(const Members& members, const SceneDescription& scene) {
    members.only({"key", "value"});
    const std::string key = members.string("key");
    const double value = members.number("value");
    const auto found = std::find_if(scene.parameters.begin(), scene.parameters.end(),
                                    [&](const ParameterDescription& parameter) { return parameter.key == key; });
    if (found == scene.parameters.end()) {
        members.refuse("this scene has no parameter of that name");
    }
    const bool chosen = !found->choices.empty();
    const double least = chosen ? 0.0 : found->least;
    const double most = chosen ? static_cast<double>(found->choices.size() - 1) : found->most;
    if (!(value >= least && value <= most)) {
        members.refuse(found->key + " must be from " + written(least) + " to " + written(most));
    }
    if ((chosen || found->whole) && value != std::floor(value)) {
        members.refuse(found->key + " must be a whole number");
    }
    return {static_cast<std::size_t>(found - scene.parameters.begin()), value};
}

SingleStep read_step(const Members& members) {
    members.only({"steps"});
    const double steps = members.has("steps") ? members.number("steps") : 1.0;
    if (!(steps >= 1.0 && steps <= kMostSteps) || steps != std::floor(steps)) {
        members.refuse("steps must be a whole number from 1 to " + std::to_string(kMostSteps));
    }
    return {static_cast<int>(steps)};
}

ChangeScene read_scene_change(const Members& members, const SceneDescription& scene) {
    members.only({"name"});
    const std::string name = members.string("name");
    if (std::find(scene.scenes.begin(), scene.scenes.end(), name) == scene.scenes.end()) {
        members.refuse("there is no scene of that name here");
    }
    return {name};
}

Quat read_orientation(const Members& members) {
    const auto [w, x, y, z] = members.numbers<4>("orientation");
    const double length = std::sqrt(w * w + x * x + y * y + z * z);
    if (!(std::abs(length - 1.0) <= kUnitTolerance)) {
        members.refuse("the orientation must be of unit length");
    }
    return {w / length, x / length, y / length, z / length};
}

MoveHand read_hand(const Members& members) {
    members.only({"position", "orientation", "curl"});
    MoveHand move;
    const auto [x, y, z] = members.numbers<3>("position");
    for (const double coordinate : {x, y, z}) {
        if (!(std::abs(coordinate) <= kFarthestHand)) {
            members.refuse("the hand may be " + written(kFarthestHand) + " m away at most");
        }
    }
    move.position = {x, y, z};
    if (members.has("orientation")) {
        move.orientation = read_orientation(members);
    }
    if (members.has("curl")) {
        move.curl = members.number("curl");
        if (!(*move.curl >= 0.0 && *move.curl <= 1.0)) {
            members.refuse("curl must be from 0 to 1");
        }
    }
    return move;
}

Seek read_seek(const Members& members, const SceneDescription& scene) {
    members.only({"time"});
    const double time = members.number("time");
    if (!(time >= 0.0 && time <= scene.length)) {
        members.refuse(scene.length > 0.0 ? "the time must be from 0 to " + written(scene.length) + " s"
                                          : "this is no recording that is played");
    }
    return {time};
}

SetSpeed read_speed(const Members& members) {
    members.only({"speed"});
    const double speed = members.number("speed");
    if (!(speed >= kSlowest && speed <= kFastest)) {
        members.refuse("speed must be from " + written(kSlowest) + " to " + written(kFastest));
    }
    return {speed};
}

/// A command without members of its own.
template <class Bare>
Bare read_bare(const Members& members) {
    members.only({});
    return {};
}

Request read_request(const Members& members, const SceneDescription& scene) {
    const std::string& type = members.type();
    if (type == "watch") {
        return read_watch(members);
    }
    if (type == "set") {
        return Command(read_set(members, scene));
    }
    if (type == "pause") {
        members.only({"on"});
        return Command(SetPaused{members.boolean("on")});
    }
    if (type == "step") {
        return Command(read_step(members));
    }
    if (type == "reset") {
        return Command(read_bare<Reset>(members));
    }
    if (type == "scene") {
        return Command(read_scene_change(members, scene));
    }
    if (type == "record") {
        members.only({"on"});
        return Command(SetRecording{members.boolean("on")});
    }
    if (type == "hand") {
        return Command(read_hand(members));
    }
    if (type == "release") {
        return Command(read_bare<ReleaseHand>(members));
    }
    if (type == "script") {
        return Command(read_bare<FollowScript>(members));
    }
    if (type == "seek") {
        return Command(read_seek(members, scene));
    }
    if (type == "speed") {
        return Command(read_speed(members));
    }
    return Malformed{"there is no message of that type"};
}

}  // namespace

Request parse_request(std::string_view text, const SceneDescription& description) {
    if (text.size() > kLongestRequest) {
        return Malformed{"longer than " + std::to_string(kLongestRequest) + " bytes"};
    }
    const Json message = Json::parse(text, nullptr, false);
    // The library takes a zero byte for the end.
    if (!message.is_object() || text.find('\0') != std::string_view::npos) {
        return Malformed{"no JSON object"};
    }
    const auto type = message.find("type");
    if (type == message.end() || !type->is_string()) {
        return Malformed{"no type"};
    }
    constexpr std::size_t longest_type = 16;
    if (type->get_ref<const std::string&>().size() > longest_type) {
        return Malformed{"there is no message of that type"};
    }
    try {
        return read_request({message, *type}, description);
    } catch (const Malformed& malformed) {
        return malformed;
    } catch (const Refusal& refusal) {
        return refusal;
    }
}

std::string type_of(const Command& command) {
    // As in Command.
    constexpr std::array<const char*, std::variant_size_v<Command>> types = {
        "set", "pause", "step", "reset", "scene", "record", "hand", "release", "script", "seek", "speed"};
    return types[command.index()];
}

std::string refused_message(const Refusal& refusal) {
    const Json message = {{"type", "refused"}, {"command", refusal.command}, {"why", refusal.why}};
    return message.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace haptic::sim::view
