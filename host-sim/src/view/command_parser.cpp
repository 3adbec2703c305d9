#include "view/command_parser.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <optional>
#include <type_traits>
#include <utility>

namespace haptic::sim::view {
namespace {

using Json = nlohmann::json;

constexpr int kMaxSteps = 1000;
constexpr double kMinSpeed = 0.01;  // simulated seconds per second
constexpr double kMaxSpeed = 10.0;

/// The members of a message, checked for their types. Throws Malformed and Refusal.
class Members {
  public:
    Members(const Json& message, std::string type) : message_(message), type_(std::move(type)) {}

    [[nodiscard]] const std::string& type() const noexcept { return type_; }

    /// Rejects unknown members: their sender means something that this version does not do.
    void allow_only(std::initializer_list<std::string_view> names) const {
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

std::string format_number(double number) {
    return Json(number).dump();
}

Watch read_watch(const Members& members) {
    members.allow_only({"particles", "planes", "samples"});
    const auto wants = [&](const char* name) { return members.has(name) && members.boolean(name); };
    return {wants("particles"), wants("planes"), wants("samples")};
}

SetParameter read_set(const Members& members, const SceneDescription& scene) {
    members.allow_only({"key", "value"});
    const std::string key = members.string("key");
    const double value = members.number("value");
    const auto found = std::find_if(scene.parameters.begin(), scene.parameters.end(),
                                    [&](const ParameterDescription& parameter) { return parameter.key == key; });
    if (found == scene.parameters.end()) {
        members.refuse("this scene has no parameter of that name");
    }
    // A choice is an index into its list; any other parameter has a range.
    // A choice is an index into its list; any other parameter has a range.
    const bool is_choice = !found->choices.empty();
    const double min = is_choice ? 0.0 : found->min;
    const double max = is_choice ? static_cast<double>(found->choices.size() - 1) : found->max;
    if (!(value >= min && value <= max)) {
        members.refuse(found->key + " must be from " + format_number(min) + " to " + format_number(max));
    }
    if ((is_choice || found->whole) && value != std::floor(value)) {
        members.refuse(found->key + " must be a whole number");
    }
    return {static_cast<std::size_t>(found - scene.parameters.begin()), value};
}

SingleStep read_step(const Members& members) {
    members.allow_only({"steps"});
    const double steps = members.has("steps") ? members.number("steps") : 1.0;
    if (!(steps >= 1.0 && steps <= kMaxSteps) || steps != std::floor(steps)) {
        members.refuse("steps must be a whole number from 1 to " + std::to_string(kMaxSteps));
    }
    return {static_cast<int>(steps)};
}

ChangeScene read_scene_change(const Members& members, const SceneDescription& scene) {
    members.allow_only({"name"});
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
    members.allow_only({"position", "orientation", "curl"});
    MoveHand move;
    const auto [x, y, z] = members.numbers<3>("position");
    for (const double coordinate : {x, y, z}) {
        if (!(std::abs(coordinate) <= kMaxHandCoordinate)) {
            members.refuse("each coordinate of the hand must be within " + format_number(kMaxHandCoordinate) +
                           " m of the origin");
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
    members.allow_only({"time"});
    const double time = members.number("time");
    if (!(time >= 0.0 && time <= scene.length)) {
        members.refuse(scene.length > 0.0 ? "the time must be from 0 to " + format_number(scene.length) + " s"
                                          : "this is not a recording");
    }
    return {time};
}

SetSpeed read_speed(const Members& members) {
    members.allow_only({"speed"});
    const double speed = members.number("speed");
    if (!(speed >= kMinSpeed && speed <= kMaxSpeed)) {
        members.refuse("speed must be from " + format_number(kMinSpeed) + " to " + format_number(kMaxSpeed));
    }
    return {speed};
}

/// Reads a command without members.
template <class Empty>
Empty read_empty(const Members& members) {
    members.allow_only({});
    return {};
}

SetPaused read_pause(const Members& members) {
    members.allow_only({"on"});
    return {members.boolean("on")};
}

SetRecording read_record(const Members& members) {
    members.allow_only({"on"});
    return {members.boolean("on")};
}

/// A message type and the function that reads it.
struct RequestReader {
    const char* type;
    Request (*read)(const Members&, const SceneDescription&);
};

/// Reader of a command that depends on its message alone, or on the scene as well.
template <auto kRead>
Request read_command(const Members& members, const SceneDescription& scene) {
    if constexpr (std::is_invocable_v<decltype(kRead), const Members&>) {
        return Command(kRead(members));
    } else {
        return Command(kRead(members, scene));
    }
}

/// All requests: the commands in the order of Command's alternatives, then the subscription.
constexpr std::array<RequestReader, std::variant_size_v<Command> + 1> kReaders{{
    {"set", read_command<read_set>},
    {"pause", read_command<read_pause>},
    {"step", read_command<read_step>},
    {"reset", read_command<read_empty<Reset>>},
    {"scene", read_command<read_scene_change>},
    {"record", read_command<read_record>},
    {"hand", read_command<read_hand>},
    {"release", read_command<read_empty<ReleaseHand>>},
    {"script", read_command<read_empty<FollowScript>>},
    {"seek", read_command<read_seek>},
    {"speed", read_command<read_speed>},
    {"watch", [](const Members& members, const SceneDescription& /*scene*/) { return Request(read_watch(members)); }},
}};

Request read_request(const Members& members, const SceneDescription& scene) {
    for (const RequestReader& reader : kReaders) {
        if (members.type() == reader.type) {
            return reader.read(members, scene);
        }
    }
    return Malformed{"there is no message of that type"};
}

}  // namespace

Request parse_request(std::string_view text, const SceneDescription& description) {
    if (text.size() > kMaxRequestBytes) {
        return Malformed{"longer than " + std::to_string(kMaxRequestBytes) + " bytes"};
    }
    const Json message = Json::parse(text, nullptr, false);
    // The library stops at a zero byte, so reject it here.
    if (!message.is_object() || text.find('\0') != std::string_view::npos) {
        return Malformed{"not a JSON object"};
    }
    const auto type = message.find("type");
    if (type == message.end() || !type->is_string()) {
        return Malformed{"without a type"};
    }
    // A long type would not fit into a refusal.
    constexpr std::size_t max_type_bytes = 16;
    if (type->get_ref<const std::string&>().size() > max_type_bytes) {
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
    return kReaders[command.index()].type;
}

std::string refused_message(const Refusal& refusal) {
    const Json message = {{"type", "refused"}, {"command", refusal.command}, {"why", refusal.why}};
    return message.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace haptic::sim::view
