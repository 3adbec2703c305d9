#include "documents/json_schema.hpp"

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>

namespace haptic {
namespace {

using Json = nlohmann::ordered_json;

Json table_schema() {
    return {{"type", "object"}, {"properties", Json::object()}, {"additionalProperties", false}};
}

Json number_schema(const char* type, const std::optional<Range>& range) {
    Json schema{{"type", type}};
    if (range) {
        schema["minimum"] = range->min;
        schema["maximum"] = range->max;
    }
    return schema;
}

Json list_schema(const std::optional<Range>& range_of_each) {
    return {{"type", "array"}, {"items", number_schema("number", range_of_each)}};
}

Json list_schema(const std::optional<Range>& range_of_each, std::size_t size) {
    Json schema = list_schema(range_of_each);
    schema["minItems"] = size;
    schema["maxItems"] = size;
    return schema;
}

Json value_schema(const SettingType& type) {
    if (type.name == "number" || type.name == "integer") {
        return number_schema(type.name.c_str(), type.range);
    }
    if (type.name == "true or false") {
        return {{"type", "boolean"}};
    }
    if (type.name == "text") {
        return {{"type", "string"}};
    }
    if (type.name == "choice") {
        return {{"enum", type.choices}};
    }
    if (type.name == "number or choice") {
        return {{"anyOf", {number_schema("number", type.range), {{"enum", type.choices}}}}};
    }
    if (type.name == "text or integer") {
        return {{"anyOf", {{{"type", "string"}}, number_schema("integer", type.range)}}};
    }
    if (type.name == "3 numbers") {
        return list_schema(type.range, 3);
    }
    if (type.name == "unit quaternion") {
        return list_schema(type.range, 4);
    }
    if (type.name == "list of numbers") {
        return list_schema(type.range);
    }
    throw std::logic_error("no JSON schema is known for settings of type \"" + type.name + "\"");
}

/// The words of an editor's hint: "Length of a step. Unit: s. Default: 0.01."
std::string hint_of(const SettingDescription& setting) {
    std::string hint = setting.meaning;
    if (!setting.unit.empty()) {
        hint += " Unit: " + setting.unit + ".";
    }
    const std::string& shown = setting.default_note.empty() ? setting.default_value : setting.default_note;
    if (!setting.required && !shown.empty()) {
        hint += " Default: " + shown + ".";
    }
    return hint;
}

/// The schema of the table at a path such as "model.regions", which is made with the tables around it if there is none.
/// For a repeated table it is that of one element.
Json& table_at(Json& file, std::string_view path) {
    Json* table = &file;
    while (!path.empty()) {
        const std::size_t dot = path.find('.');
        Json& properties = (*table)["properties"];
        const std::string name(path.substr(0, dot));
        if (!properties.contains(name)) {
            properties[name] = table_schema();
        }
        Json& found = properties[name];
        table = found.contains("items") ? &found["items"] : &found;
        path = dot == std::string_view::npos ? std::string_view() : path.substr(dot + 1);
    }
    return *table;
}

void add_old_key(Json& file, const std::string& old_key, const std::string& new_key, Json schema) {
    const std::size_t dot = old_key.rfind('.');
    const std::string path = dot == std::string::npos ? std::string() : old_key.substr(0, dot);
    schema["description"] = "Former name of " + new_key + ".";
    schema["deprecated"] = true;
    table_at(file, path)["properties"][dot == std::string::npos ? old_key : old_key.substr(dot + 1)] =
        std::move(schema);
}

void add_section_schema(Json& file, const SettingSection& section) {
    if (section.kind == SectionKind::Repeated) {
        const std::size_t dot = section.path.rfind('.');
        const std::string around = dot == std::string::npos ? std::string() : section.path.substr(0, dot);
        const std::string name = dot == std::string::npos ? section.path : section.path.substr(dot + 1);
        table_at(file, around)["properties"][name] = {
            {"type", "array"}, {"description", section.meaning}, {"items", table_schema()}};
    }
    Json& table = table_at(file, section.path);
    if (!section.same_keys_as.empty()) {
        table = table_at(file, section.same_keys_as);
    }
    if (!section.meaning.empty() && !section.path.empty()) {
        table["description"] = section.meaning;
    }
    if (section.or_text) {
        table["type"] = {"object", "string"};
    }
    for (const SettingDescription& setting : section.settings) {
        Json schema = value_schema(setting.type);
        if (!setting.old_key.empty()) {
            add_old_key(file, setting.old_key, full_key(section, setting), schema);
        }
        schema["description"] = hint_of(setting);
        // Found again: a former name may have added a table to the same list.
        Json& place = table_at(file, section.path);
        place["properties"][setting.key] = std::move(schema);
        if (setting.required) {
            place["required"].push_back(setting.key);
        }
    }
}

}  // namespace

std::string json_schema(const std::string& title, const SettingReference& reference) {
    Json file{{"$schema", "http://json-schema.org/draft-07/schema#"}, {"title", title}};
    file.update(table_schema());
    // A table that repeats the keys of another one comes after all of those.
    for (const SettingSection& section : reference) {
        if (section.same_keys_as.empty()) {
            add_section_schema(file, section);
        }
    }
    for (const SettingSection& section : reference) {
        if (!section.same_keys_as.empty()) {
            add_section_schema(file, section);
        }
    }
    return file.dump(2) + '\n';
}

}  // namespace haptic
