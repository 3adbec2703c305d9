#include "app/query_ccd.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <istream>
#include <ostream>
#include <stdexcept>
#include <string>
#include <string_view>

#include "contact/triangle_query.hpp"

namespace haptic::sim {

namespace {

constexpr std::size_t kNumbers = 22;

std::string_view trimmed(std::string_view text) {
    const auto first = text.find_first_not_of(" \t\r");
    if (first == std::string_view::npos) {
        return {};
    }
    return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// Parses a field. Throws std::invalid_argument that names it.
double number(std::string_view field, std::size_t index) {
    std::string_view text = trimmed(field);
    if (text.size() > 1 && text[0] == '+' && text[1] != '-') {
        text.remove_prefix(1);
    }
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) {
        throw std::invalid_argument("field " + std::to_string(index + 1) + " is not a finite number: \"" +
                                    std::string(trimmed(field)) + "\"");
    }
    return value;
}

TriangleQuery parse(std::string_view line) {
    std::array<double, kNumbers> x{};
    std::size_t count = 0;
    for (std::size_t begin = 0; begin <= line.size(); ++count) {
        const std::size_t end = std::min(line.find(',', begin), line.size());
        if (count < kNumbers) {
            x[count] = number(line.substr(begin, end - begin), count);
        }
        begin = end + 1;
    }
    if (count != kNumbers) {
        throw std::invalid_argument("expected " + std::to_string(kNumbers) +
                                    " numbers (px,py,pz,r and two triangles of 9), found " + std::to_string(count));
    }
    const auto vec = [&](std::size_t k) { return Vec3(x[k], x[k + 1], x[k + 2]); };
    TriangleQuery q{vec(0), x[3], {{vec(4), vec(7), vec(10)}, {vec(13), vec(16), vec(19)}}};
    if (!(q.radius > 0.0)) {
        throw std::invalid_argument("the radius (field 4) must be greater than 0");
    }
    return q;
}

void append(std::string& line, double value) {
    std::array<char, 32> digits{};
    const double unsigned_zero = value + 0.0;
    const auto result = std::to_chars(digits.data(), digits.data() + digits.size(), unsigned_zero);
    line += ',';
    line.append(digits.data(), result.ptr);
}

void append(std::string& line, const Vec3& value) {
    append(line, value.x);
    append(line, value.y);
    append(line, value.z);
}

std::string answer_line(const TriangleAnswer& answer) {
    std::string line = describe(answer.touched);
    if (answer.touched == Feature::None) {
        line += ",,,,,";
    } else {
        append(line, answer.touch_time);
        if (answer.passage_time) {
            append(line, *answer.passage_time);
        } else {
            line += ',';
        }
        append(line, answer.normal);
    }
    append(line, answer.secure_position);
    return line;
}

}  // namespace

int query_ccd(std::istream& queries, std::ostream& answers, std::ostream& errors,
              const std::function<void(std::size_t bytes)>& read) {
    int status = 0;
    std::string line;
    std::size_t bytes = 0;
    for (std::size_t number = 1; std::getline(queries, line); ++number) {
        bytes += line.size() + 1;
        if (read) {
            read(bytes);
        }
        const std::string_view text = trimmed(std::string_view(line).substr(0, line.find('#')));
        if (text.empty()) {
            continue;
        }
        try {
            answers << answer_line(answer(parse(text))) << '\n';
        } catch (const std::invalid_argument& problem) {
            errors << "line " << number << ": " << problem.what() << '\n';
            status = 2;
        }
    }
    answers.flush();
    return status;
}

}  // namespace haptic::sim
