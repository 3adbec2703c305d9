#include "haptic/config.hpp"

// toml++ 3.3 asserts that a table's name begins as a name does, which a file such as "[.a]" does not, and without
// assertions takes it for granted. Here it throws, in every build.
namespace haptic {
struct BrokenAssertion {};
[[noreturn]] static void break_assertion() {
    throw BrokenAssertion();
}
}  // namespace haptic
#undef NDEBUG
#define TOML_ASSERT(expr) ((expr) ? static_cast<void>(0) : haptic::break_assertion())
#include <toml++/toml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <iterator>
#include <numeric>
#include <optional>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

namespace haptic {
namespace {

constexpr double kUnitTolerance = 1e-6;
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

std::vector<std::string> split(std::string_view key) {
    std::vector<std::string> parts;
    for (std::size_t begin = 0;;) {
        const std::size_t dot = key.find('.', begin);
        parts.emplace_back(key.substr(begin, dot - begin));
        if (dot == std::string_view::npos) {
            return parts;
        }
        begin = dot + 1;
    }
}

std::string_view last_part(std::string_view key) {
    const std::size_t dot = key.rfind('.');
    return dot == std::string_view::npos ? key : key.substr(dot + 1);
}

std::string_view table_part(std::string_view key) {
    const std::size_t dot = key.rfind('.');
    return dot == std::string_view::npos ? std::string_view{} : key.substr(0, dot);
}

std::string in_quotes(std::string_view text) {
    return "\"" + std::string(text) + "\"";
}

std::string shown(double value) {
    char digits[32];
    const auto end = std::to_chars(std::begin(digits), std::end(digits), value).ptr;
    return {digits, end};
}

std::string shown(Range range) {
    return "[" + shown(range.least) + ", " + shown(range.most) + "]";
}

/// As in the file. Lists by hand: toml++ 3.3 converts the logarithm of a fraction in one to an unsigned number.
// NOLINTNEXTLINE(misc-no-recursion): no deeper than the parser lets lists be nested
std::string shown(const toml::node& node) {
    if (const toml::array* const array = node.as_array(); array != nullptr && !array->empty()) {
        std::string text;
        for (const toml::node& element : *array) {
            text += (text.empty() ? "[ " : ", ") + shown(element);
        }
        return text + " ]";
    }
    if (node.is_table()) {
        return "a table";
    }
    std::ostringstream out;
    out << toml::node_view<const toml::node>(node);
    return out.str();
}

std::string trimmed(std::string_view text) {
    const std::size_t begin = text.find_first_not_of(" \t");
    const std::size_t end = text.find_last_not_of(" \t");
    return begin == std::string_view::npos ? "" : std::string(text.substr(begin, end - begin + 1));
}

/// Number of insertions, deletions, replacements and swaps of neighbours that make b of a (optimal string alignment).
std::size_t edit_distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> before_last(b.size() + 1);
    std::vector<std::size_t> last(b.size() + 1);
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(last.begin(), last.end(), std::size_t{0});
    for (std::size_t i = 1; i <= a.size(); ++i) {
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t replaced = last[j - 1] + (a[i - 1] == b[j - 1] ? 0u : 1u);
            row[j] = std::min({replaced, last[j] + 1, row[j - 1] + 1});
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
                row[j] = std::min(row[j], before_last[j - 2] + 1);
            }
        }
        std::swap(before_last, last);
        std::swap(last, row);
    }
    return last.back();
}

/// The end of the message about an unknown key: the known key that was probably meant, or what its table may hold.
std::string remedy(const std::string& unknown, const std::set<std::string>& known) {
    const std::string* nearest = nullptr;
    std::size_t nearest_distance = std::max<std::size_t>(2, unknown.size() / 3) + 1;
    for (const std::string& candidate : known) {
        if (last_part(candidate) == last_part(unknown)) {
            return "; did you mean " + in_quotes(candidate) + "?";  // the right name in the wrong table
        }
        if (const std::size_t distance = edit_distance(unknown, candidate); distance < nearest_distance) {
            nearest = &candidate;
            nearest_distance = distance;
        }
    }
    if (nearest != nullptr) {
        return "; did you mean " + in_quotes(*nearest) + "?";
    }
    std::string neighbours;
    for (const std::string& candidate : known) {
        if (table_part(candidate) == table_part(unknown)) {
            neighbours += (neighbours.empty() ? "" : ", ") + std::string(last_part(candidate));
        }
    }
    const std::string place =
        table_part(unknown).empty() ? "at the top" : "in [" + std::string(table_part(unknown)) + "]";
    return neighbours.empty() ? "" : "; known " + place + ": " + neighbours;
}

/// A word that may stand without quotes after "--set key=": a name, a path, a time; nothing that looks like broken
/// TOML.
bool is_bare_word(std::string_view value) {
    const auto starts_word = [](char c) {
        return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '/' || c == '.' || c == '~';
    };
    const auto breaks_word = [](char c) {
        return std::iscntrl(static_cast<unsigned char>(c)) != 0 ||
               std::string_view("\"'[]{}#=,").find(c) != std::string_view::npos;
    };
    return !value.empty() && starts_word(value.front()) && std::none_of(value.begin(), value.end(), breaks_word);
}

/// The node below another one: by its name in a table, by its number in a list.
const toml::node* child(const toml::node& node, const std::string& part) {
    if (const toml::table* const table = node.as_table()) {
        return table->get(part);
    }
    const toml::array* const array = node.as_array();
    std::size_t index = 0;
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), index);
    const bool is_index = error == std::errc{} && end == part.data() + part.size();
    return array != nullptr && is_index ? array->get(index) : nullptr;
}

/// A character that toml++ 3.3 must not meet: for some of those beyond ASCII it runs into what it takes for unreachable
/// when it asks whether they are spaces.
struct Stray {
    std::size_t at;
    const char* rule;
};

bool is_ascii(char c) {
    return static_cast<unsigned char>(c) < 0x80;
}

/// The end of a string in quotes that begins at `begin`: after its last quote, or where its line ends without one. At a
/// stray character in it, that is noted.
std::size_t end_of_string(std::string_view toml, std::size_t begin, std::optional<Stray>& stray) {
    const char quote = toml[begin];
    const std::string three(3, quote);
    const bool multi_line = toml.substr(begin, 3) == three;
    for (std::size_t i = begin + (multi_line ? 3 : 1); i < toml.size(); ++i) {
        if (quote == '"' && toml[i] == '\\') {
            ++i;
            if (!multi_line) {
                continue;
            }
            // At the end of a line it takes with it all space up to the next character, which may be a quote again.
            const std::size_t next = std::min(toml.find_first_not_of(" \t\r\n", i), toml.size());
            if (next < toml.size() && !is_ascii(toml[next])) {
                stray = {next, "after a backslash in a string of several lines only ASCII may stand"};
                return next;
            }
            i = next > i ? next - 1 : i;
        } else if (multi_line && toml.substr(i, 3) == three) {
            // Up to two more quotes belong to the text itself.
            std::size_t end = i + 3;
            while (end < toml.size() && end < i + 5 && toml[end] == quote) {
                ++end;
            }
            return end;
        } else if (!multi_line && (toml[i] == quote || toml[i] == '\n')) {
            return i + 1;
        }
    }
    return toml.size();
}

/// The first of them. TOML allows none outside of strings and comments; what follows a backslash that ends a line of a
/// string it does allow.
std::optional<Stray> stray_character(std::string_view toml) {
    std::optional<Stray> stray;
    std::size_t i = toml.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
    while (i < toml.size() && !stray) {
        const char c = toml[i];
        if (!is_ascii(c)) {
            return Stray{i, "outside of strings and comments only ASCII may stand"};
        }
        if (c == '"' || c == '\'') {
            i = end_of_string(toml, i, stray);
        } else if (c == '#') {
            i = std::min(toml.find('\n', i), toml.size());
        } else {
            ++i;
        }
    }
    return stray;
}

bool breaks_an_assertion(std::string_view toml) {
    try {
        static_cast<void>(toml::parse(toml));
        return false;
    } catch (const BrokenAssertion&) {
        return true;
    } catch (const toml::parse_error&) {
        return false;  // the part ends in the middle of something
    }
}

/// The number of the line that breaks an assertion of the parser: the parser goes from the front to the back, so a part
/// of the text from its start breaks it exactly if it reaches that line.
std::size_t line_of_broken_assertion(std::string_view toml) {
    std::vector<std::size_t> ends;  // of each line
    for (std::size_t i = 0; i < toml.size(); ++i) {
        if (toml[i] == '\n' || i + 1 == toml.size()) {
            ends.push_back(i + 1);
        }
    }
    const auto first = std::partition_point(ends.begin(), ends.end(),
                                            [&](std::size_t end) { return !breaks_an_assertion(toml.substr(0, end)); });
    return static_cast<std::size_t>(first - ends.begin()) + 1;
}

}  // namespace

struct Config::State {
    std::string name;  // of the file, for messages; empty without one
    toml::table root;
    std::set<std::string> overridden;  // keys given by set(), for messages
    std::set<std::string> known;       // keys that a getter asked for

    const toml::node* find(const std::string& key) const {
        const toml::node* node = &root;
        for (const std::string& part : split(key)) {
            node = child(*node, part);
            if (node == nullptr) {
                return nullptr;
            }
        }
        return node;
    }

    const toml::node* ask(const std::string& key) {
        known.insert(key);
        return find(key);
    }

    /// The override that gave this key its value: itself or a table around it.
    std::optional<std::string> override_of(std::string_view key) const {
        for (; !key.empty(); key = table_part(key)) {
            if (const auto found = overridden.find(std::string(key)); found != overridden.end()) {
                return *found;
            }
        }
        return std::nullopt;
    }

    /// "FILE:LINE: KEY: ", "--set KEY: ", or as much of it as there is.
    std::string where(const std::string& key) const {
        if (const auto set_key = override_of(key)) {
            return "--set " + *set_key + ": " + (*set_key == key ? "" : key + ": ");
        }
        const std::string file = name.empty() ? "configuration" : name;
        // Of a key that is missing, the line of the table that should have it.
        const toml::node* node = find(key);
        for (std::string_view around = table_part(key); node == nullptr && !around.empty();
             around = table_part(around)) {
            node = find(std::string(around));
        }
        return file + (node == nullptr ? "" : ":" + std::to_string(node->source().begin.line)) + ": " + key + ": ";
    }

    [[noreturn]] void fail(const std::string& key, const std::string& problem) const {
        throw ConfigError(where(key) + problem);
    }

    double checked_number(const std::string& key, const toml::node& node, Range range) const {
        const std::optional<double> value = node.is_number() ? node.value<double>() : std::nullopt;
        if (!value) {
            fail(key, "must be a number, is " + shown(node));
        }
        if (!std::isfinite(*value)) {
            fail(key, "must be a finite number, is " + shown(node));
        }
        if (*value < range.least || *value > range.most) {
            fail(key, "must be within " + shown(range) + ", is " + shown(*value));
        }
        return *value;
    }

    std::vector<double> checked_numbers(const std::string& key, const toml::node& node, Range range_of_each) const {
        const toml::array* const array = node.as_array();
        if (array == nullptr) {
            fail(key, "must be a list of numbers, is " + shown(node));
        }
        std::vector<double> values;
        for (const toml::node& element : *array) {
            values.push_back(checked_number(key, element, range_of_each));
        }
        return values;
    }

    std::vector<double> checked_numbers(const std::string& key, const toml::node& node, Range range_of_each,
                                        std::size_t count) const {
        std::vector<double> values = checked_numbers(key, node, range_of_each);
        if (values.size() != count) {
            fail(key, "must have " + std::to_string(count) + " numbers, has " + std::to_string(values.size()));
        }
        return values;
    }

    struct Unknown {
        std::string key;
        toml::source_index line;
    };

    bool holds_known(const std::string& table) const {
        const auto next = known.lower_bound(table + ".");
        return next != known.end() && next->starts_with(table + ".");
    }

    /// Every key below the table that nobody asked for; a table of which nothing is known counts as one key if empty.
    void collect_unknown(const toml::table& table, const std::string& prefix, std::vector<Unknown>& unknown) const {
        for (const auto& [name_of_key, node] : table) {
            const std::string key = prefix + std::string(name_of_key.str());
            if (const toml::array* const array = node.as_array(); array != nullptr && holds_known(key)) {
                collect_unknown(*array, key, unknown);
                continue;
            }
            if (known.contains(key)) {
                continue;
            }
            const toml::table* const inner = node.as_table();
            if (inner != nullptr && (!inner->empty() || holds_known(key))) {
                collect_unknown(*inner, key + ".", unknown);
            } else {
                unknown.push_back({key, override_of(key) ? 0 : node.source().begin.line});
            }
        }
    }

    void collect_unknown(const toml::array& tables, const std::string& key, std::vector<Unknown>& unknown) const {
        for (std::size_t i = 0; i < tables.size(); ++i) {
            if (const toml::table* const table = tables[i].as_table()) {
                collect_unknown(*table, key + "." + std::to_string(i) + ".", unknown);
            }
        }
    }
};

Config::Config() : state_(std::make_unique<State>()) {}
Config::Config(Config&&) noexcept = default;
Config& Config::operator=(Config&&) noexcept = default;
Config::~Config() = default;

Config Config::load(const std::filesystem::path& file) {
    errno = 0;
    std::ifstream stream(file, std::ios::binary);
    std::ostringstream content;
    if (!stream || std::filesystem::is_directory(file) || !(content << stream.rdbuf()).good()) {
        // An empty file leaves `content` failed without an error: it is an empty configuration.
        if (stream.is_open() && !std::filesystem::is_directory(file) && content.str().empty()) {
            return parse("", file.string());
        }
        const std::string reason =
            std::filesystem::is_directory(file) ? "is a directory" : std::generic_category().message(errno);
        throw ConfigError(file.string() + ": cannot be read: " + reason);
    }
    return parse(content.str(), file.string());
}

Config Config::parse(std::string_view toml, std::string_view name) {
    Config config;
    config.state_->name = name;
    if (const std::optional<Stray> stray = stray_character(toml)) {
        const auto line = 1 + std::count(toml.begin(), toml.begin() + static_cast<std::ptrdiff_t>(stray->at), '\n');
        throw ConfigError(std::string(name) + ":" + std::to_string(line) + ": not valid TOML: " + stray->rule);
    }
    try {
        config.state_->root = toml::parse(toml, name);
    } catch (const toml::parse_error& error) {
        throw ConfigError(std::string(name) + ":" + std::to_string(error.source().begin.line) +
                          ": not valid TOML: " + std::string(error.description()));
    } catch (const BrokenAssertion&) {
        throw ConfigError(std::string(name) + ":" + std::to_string(line_of_broken_assertion(toml)) +
                          ": not valid TOML: a name must begin with a letter, a digit, _ or -, or be in quotes");
    }
    return config;
}

void Config::set(std::string_view assignment) {
    const std::size_t equals = assignment.find('=');
    const std::string key = trimmed(assignment.substr(0, equals));
    const auto fail_set = [&key](const std::string& problem) { throw ConfigError("--set " + key + ": " + problem); };
    if (equals == std::string_view::npos) {
        fail_set("must have the form key=value");
    }
    const std::vector<std::string> parts = split(key);
    for (const std::string& part : parts) {
        const auto allowed = [](char c) {
            return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-';
        };
        if (part.empty() || !std::all_of(part.begin(), part.end(), allowed)) {
            fail_set("is not a key: names of letters, digits, _ and - with dots between, as in tension.minimum_n");
        }
    }
    const std::string value = trimmed(assignment.substr(equals + 1));
    toml::table parsed;
    if (value.find('\n') != std::string_view::npos) {
        fail_set("the value must be on one line");
    }
    const std::optional<Stray> stray = stray_character(value);
    std::optional<std::string> problem;
    if (stray) {
        problem = stray->rule;
    } else {
        try {
            parsed = toml::parse("value = " + value + "\n");
        } catch (const toml::parse_error& error) {
            problem = std::string(error.description());
        }
    }
    if (problem) {
        if (!is_bare_word(value)) {
            fail_set(in_quotes(value) + " is not a TOML value: " + *problem);
        }
        parsed.insert_or_assign("value", value);
    }
    toml::table* table = &state_->root;
    for (std::size_t i = 0; i + 1 < parts.size(); ++i) {
        toml::node& inner = table->insert(parts[i], toml::table{}).first->second;
        table = inner.as_table();
        if (table == nullptr) {
            fail_set(in_quotes(parts[i]) + " is a value, not a table");
        }
    }
    table->insert_or_assign(parts.back(), std::move(*parsed.get("value")));
    state_->overridden.insert(key);
}

double Config::number(const std::string& key, double otherwise, Range range) const {
    const toml::node* const node = state_->ask(key);
    return node == nullptr ? otherwise : state_->checked_number(key, *node, range);
}

std::int64_t Config::integer(const std::string& key, std::int64_t otherwise, Range range) const {
    const toml::node* const node = state_->ask(key);
    if (node == nullptr) {
        return otherwise;
    }
    if (!node->is_integer()) {
        state_->fail(key, "must be an integer, is " + shown(*node));
    }
    static_cast<void>(state_->checked_number(key, *node, range));
    return node->as_integer()->get();
}

bool Config::flag(const std::string& key, bool otherwise) const {
    const toml::node* const node = state_->ask(key);
    if (node != nullptr && !node->is_boolean()) {
        state_->fail(key, "must be true or false, is " + shown(*node));
    }
    return node == nullptr ? otherwise : node->as_boolean()->get();
}

std::string Config::text(const std::string& key, const std::string& otherwise) const {
    const toml::node* const node = state_->ask(key);
    if (node != nullptr && !node->is_string()) {
        state_->fail(key, "must be a string in quotes, is " + shown(*node));
    }
    return node == nullptr ? otherwise : node->as_string()->get();
}

std::string Config::choice(const std::string& key, const std::string& otherwise,
                           const std::vector<std::string>& choices) const {
    std::string value = text(key, otherwise);
    if (std::find(choices.begin(), choices.end(), value) == choices.end()) {
        std::string list;
        for (const std::string& choice : choices) {
            list += (list.empty() ? "" : ", ") + in_quotes(choice);
        }
        state_->fail(key, "must be one of " + list + ", is " + in_quotes(value));
    }
    return value;
}

Vec3 Config::vec3(const std::string& key, const Vec3& otherwise, Range range_of_each) const {
    const toml::node* const node = state_->ask(key);
    if (node == nullptr) {
        return otherwise;
    }
    const std::vector<double> values = state_->checked_numbers(key, *node, range_of_each, 3);
    return {values[0], values[1], values[2]};
}

Quat Config::quat(const std::string& key, const Quat& otherwise) const {
    const toml::node* const node = state_->ask(key);
    if (node == nullptr) {
        return otherwise;
    }
    const std::vector<double> values = state_->checked_numbers(key, *node, {-2.0, 2.0}, 4);
    const Quat quat(values[0], values[1], values[2], values[3]);
    if (std::abs(glm::length(quat) - 1.0) > kUnitTolerance) {
        state_->fail(key, "must be a unit quaternion (w, x, y, z), its length is " + shown(glm::length(quat)));
    }
    return glm::normalize(quat);
}

std::vector<double> Config::numbers(const std::string& key, const std::vector<double>& otherwise,
                                    Range range_of_each) const {
    const toml::node* const node = state_->ask(key);
    return node == nullptr ? otherwise : state_->checked_numbers(key, *node, range_of_each);
}

std::size_t Config::tables(const std::string& key) const {
    const toml::node* const node = state_->ask(key);
    if (node == nullptr) {
        return 0;
    }
    if (!node->is_array_of_tables()) {
        state_->fail(key, "must be tables, each headed [[" + key + "]], is " + shown(*node));
    }
    return node->as_array()->size();
}

std::string Config::toml() const {
    std::ostringstream out;
    out << toml::toml_formatter(state_->root) << '\n';
    return out.str();
}

bool Config::has(const std::string& key) const {
    return state_->find(key) != nullptr;
}

bool Config::has_text(const std::string& key) const {
    const toml::node* const node = state_->find(key);
    return node != nullptr && node->is_string();
}

void Config::fail(const std::string& key, const std::string& problem) const {
    state_->fail(key, problem);
}

std::vector<std::string> Config::known_keys() const {
    return {state_->known.begin(), state_->known.end()};
}

void Config::reject_unknown() const {
    std::vector<State::Unknown> unknown;
    state_->collect_unknown(state_->root, "", unknown);
    if (unknown.empty()) {
        return;
    }
    const auto earlier = [](const State::Unknown& a, const State::Unknown& b) { return a.line < b.line; };
    const std::string key = std::min_element(unknown.begin(), unknown.end(), earlier)->key;
    state_->fail(key, "unknown key" + remedy(key, state_->known));
}

}  // namespace haptic
