// Plots with logarithmic axes as inline SVG, in the colours of the page around them.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace haptic::rt {

/// Part of an axis, in the unit of what is plotted.
struct AxisRange {
    double from = 1.0;
    double to = 10.0;
};

/// Positive, and at least a few per cent wide.
[[nodiscard]] AxisRange wide_enough(double from, double to);

/// Where an axis has labels: 1, 2 and 5 times powers of ten, or fewer or more of them as there is room.
[[nodiscard]] std::vector<double> log_ticks(AxisRange range);

/// "0.5", "20", "1,500", "2 million" as a label.
[[nodiscard]] std::string number_text(double value);

class SvgPlot {
  public:
    /// Labels of the axes; a linear x axis instead of a logarithmic one where asked for.
    SvgPlot(AxisRange x, AxisRange y, std::string x_label, std::string y_label, bool linear_x = false);

    /// Labels of the x axis other than the ticks of its numbers.
    void set_x_ticks(std::vector<std::pair<double, std::string>> ticks) { x_ticks_ = std::move(ticks); }
    /// From the lower edge of the plot up to y.
    void bar(double x_from, double x_to, double y, const char* css_class);
    /// Through all points, in steps or straight; a gap where y is not positive.
    void line(const std::vector<std::pair<double, double>>& points, const char* css_class);
    /// A vertical line with a word at its upper end.
    void mark(double x, const std::string& word);
    /// A word in the key, with the colour of a class.
    void key(const std::string& word, const char* css_class);

    [[nodiscard]] std::string svg(const std::string& title) const;

  private:
    [[nodiscard]] double at_x(double value) const;
    [[nodiscard]] double at_y(double value) const;
    [[nodiscard]] std::string axes() const;

    AxisRange x_;
    AxisRange y_;
    std::string x_label_;
    std::string y_label_;
    bool linear_x_;
    std::vector<std::pair<double, std::string>> x_ticks_;
    std::string body_;
    std::string key_;
    double key_x_;
    double last_mark_ = -1e9;
};

}  // namespace haptic::rt
