#include "measure/svg_plot.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "haptic/html.hpp"

namespace haptic::rt {
namespace {

// Layout in pixels of the SVG's own coordinate system; y points down.
constexpr double kWidth = 720.0;
constexpr double kHeight = 290.0;
constexpr double kLeft = 72.0;
constexpr double kRight = 14.0;
constexpr double kTop = 34.0;
constexpr double kBottom = 44.0;
constexpr double kMarkRoom = 38.0;    // width reserved for the label of a mark
constexpr double kLetterWidth = 7.0;  // about that of the page's font
constexpr double kCrossRadius = 4.0;
constexpr std::size_t kFewestLabels = 3;
constexpr std::size_t kManyTicks = 10;

template <class... Values>
std::string formatted(const char* format, Values... values) {
    std::array<char, 400> text{};
    std::snprintf(text.data(), text.size(), format, values...);
    return text.data();
}

/// Multiples of 1, 2 or 5 times a power of ten, with a step that puts about six of them into the range.
std::vector<double> linear_ticks(AxisRange range) {
    const double rough = (range.to - range.from) / 6.0;
    const double power = std::pow(10.0, std::floor(std::log10(rough)));
    const double part = rough / power;
    const double step = power * (part <= 1.0 ? 1.0 : part <= 2.0 ? 2.0 : part <= 5.0 ? 5.0 : 10.0);
    const auto first = static_cast<long>(std::ceil(range.from / step));
    const auto last = static_cast<long>(std::floor(range.to / step * (1.0 + 1e-9)));
    std::vector<double> ticks;
    for (long i = first; i <= last; ++i) {
        ticks.push_back(static_cast<double>(i) * step);
    }
    return ticks;
}

/// Values multiple * 10^n that lie within the range.
std::vector<double> multiples_of_powers(AxisRange range, const std::vector<double>& multiples) {
    const int first = static_cast<int>(std::floor(std::log10(range.from)));
    const int last = static_cast<int>(std::floor(std::log10(range.to)));
    std::vector<double> ticks;
    for (int power = first; power <= last; ++power) {
        for (const double multiple : multiples) {
            const double at = multiple * std::pow(10.0, power);
            if (at >= range.from * (1.0 - 1e-9) && at <= range.to * (1.0 + 1e-9)) {
                ticks.push_back(at);
            }
        }
    }
    return ticks;
}

/// Centre of a label at x, moved inwards where the label would cross the edge of the plot.
double label_centre(double x, const std::string& label) {
    const double half = kLetterWidth * static_cast<double>(label.size()) / 2.0;
    return std::clamp(x, half, kWidth - half);
}

}  // namespace

AxisRange wide_enough(double from, double to) {
    from = std::max(from, 1e-3);
    to = std::max(to, from);
    const double middle = std::sqrt(from * to);
    return {std::min(from, middle / 1.03), std::max(to, middle * 1.03)};
}

std::vector<double> log_ticks(AxisRange range) {
    std::vector<double> ticks = multiples_of_powers(range, {1.0, 2.0, 5.0});
    if (ticks.size() > kManyTicks) {
        ticks = multiples_of_powers(range, {1.0});
    }
    return ticks.size() < kFewestLabels ? linear_ticks(range) : ticks;
}

std::string number_text(double value) {
    if (value >= 1e6) {
        return formatted("%.3g million", value * 1e-6);
    }
    if (value >= 1000.0) {
        const auto whole = static_cast<long>(std::lround(value));
        return formatted("%ld,%03ld", whole / 1000, whole % 1000);
    }
    return formatted("%.4g", value);
}

SvgPlot::SvgPlot(AxisRange x, AxisRange y, std::string x_label, std::string y_label, bool linear_x)
    : x_(x), y_(y), x_label_(std::move(x_label)), y_label_(std::move(y_label)), linear_x_(linear_x), key_x_(kLeft) {
    for (const double at : linear_x ? linear_ticks(x) : log_ticks(x)) {
        x_ticks_.emplace_back(at, number_text(at));
    }
}

double SvgPlot::at_x(double value) const {
    const double part = linear_x_ ? (value - x_.from) / (x_.to - x_.from)
                                  : std::log(std::max(value, 1e-12) / x_.from) / std::log(x_.to / x_.from);
    return kLeft + std::clamp(part, 0.0, 1.0) * (kWidth - kLeft - kRight);
}

double SvgPlot::at_y(double value) const {
    const double part = std::log(std::max(value, 1e-12) / y_.from) / std::log(y_.to / y_.from);
    return kHeight - kBottom - std::clamp(part, 0.0, 1.0) * (kHeight - kTop - kBottom);
}

void SvgPlot::bar(double x_from, double x_to, double y, const char* css_class) {
    const double left = at_x(x_from);
    const double top = at_y(y);
    body_ += formatted("<rect class=\"%s\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n", css_class, left,
                       top, std::max(0.5, at_x(x_to) - left), kHeight - kBottom - top);
}

void SvgPlot::line(const std::vector<std::pair<double, double>>& points, const char* css_class) {
    std::string path;
    bool drawing = false;
    for (const auto& [x, y] : points) {
        if (!(y > 0.0)) {
            drawing = false;
            continue;
        }
        path += formatted("%s%.1f %.1f ", drawing ? "L" : "M", at_x(x), at_y(y));
        drawing = true;
    }
    body_ += "<path class=\"" + std::string(css_class) + "\" d=\"" + path + "\"/>\n";
}

void SvgPlot::cell(AxisRange x, AxisRange y, const std::string& colour) {
    const double left = at_x(x.from);
    const double top = at_y(y.to);
    body_ += formatted("<rect style=\"fill:%s\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n",
                       colour.c_str(), left, top, at_x(x.to) - left, at_y(y.from) - top);
}

void SvgPlot::cross(double x, double y) {
    const double left = at_x(x) - kCrossRadius;
    const double top = at_y(y) - kCrossRadius;
    const double size = 2.0 * kCrossRadius;
    body_ += formatted("<path style=\"stroke:#000\" d=\"M%.1f %.1fl%.1f %.1fm%.1f 0l%.1f %.1f\"/>\n", left, top, size,
                       size, -size, size, -size);
}

void SvgPlot::mark(double x, const std::string& label) {
    const double at = at_x(x);
    body_ += formatted("<line class=\"mark\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>\n", at, kTop, at,
                       kHeight - kBottom);
    // A label that would overlap the previous one is left out.
    if (at - last_mark_ >= kMarkRoom) {
        body_ += formatted("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">%s</text>\n", at, kTop - 4.0,
                           at > kWidth - kRight - kMarkRoom / 2.0 ? "end" : "middle", html_text(label).c_str());
        last_mark_ = at;
    }
}

void SvgPlot::key(const std::string& label, const char* css_class) {
    key_ += formatted(
        "<rect class=\"%s key\" x=\"%.1f\" y=\"6\" width=\"12\" height=\"8\"/>"
        "<text x=\"%.1f\" y=\"14\">%s</text>\n",
        css_class, key_x_, key_x_ + 17.0, html_text(label).c_str());
    key_x_ += 34.0 + kLetterWidth * static_cast<double>(label.size());  // 34: swatch and gaps
}

std::string SvgPlot::axes() const {
    std::string text;
    const double bottom = kHeight - kBottom;
    // Grid line and label of each tick of the x axis.
    for (const auto& [at, label] : x_ticks_) {
        const double x = at_x(at);
        text += formatted("<line class=\"grid\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>", x, kTop, x, bottom);
        text += formatted("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%s</text>\n", label_centre(x, label),
                          bottom + 16.0, html_text(label).c_str());
    }
    // Grid line and label of each tick of the y axis.
    for (const double at : log_ticks(y_)) {
        const double y = at_y(at);
        text += formatted("<line class=\"grid\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>", kLeft, y,
                          kWidth - kRight, y);
        text += formatted("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%s</text>\n", kLeft - 6.0, y + 4.0,
                          number_text(at).c_str());
    }
    // Labels of the axes.
    text += formatted("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%s</text>\n", (kLeft + kWidth - kRight) / 2.0,
                      kHeight - 8.0, html_text(x_label_).c_str());
    text += formatted("<text transform=\"translate(14 %.1f) rotate(-90)\" text-anchor=\"middle\">%s</text>\n",
                      (kTop + bottom) / 2.0, html_text(y_label_).c_str());
    return text;
}

std::string SvgPlot::svg(const std::string& title) const {
    return formatted("<svg class=\"plot\" viewBox=\"0 0 %.0f %.0f\" role=\"img\" aria-label=\"%s\">\n", kWidth, kHeight,
                     html_text(title).c_str()) +
           axes() + body_ + key_ + "</svg>";
}

}  // namespace haptic::rt
