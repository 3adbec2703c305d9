// SVG plots: bars, lines and maps over a logarithmic y axis, as inline SVG in the colours of the page around them.
//
// All plots of rt-core are drawn by this class: the pages of `rt-core measure` and `rt-core stability`.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace haptic::rt {

/// Range of an axis, in the unit of the plotted quantity.
struct AxisRange {
    double from = 1.0;
    double to = 10.0;
};

/// The range, made positive and at least a few per cent wide.
[[nodiscard]] AxisRange wide_enough(double from, double to);

/// Tick values of a logarithmic axis: 1, 2 and 5 times powers of ten, fewer or more as space permits.
[[nodiscard]] std::vector<double> log_ticks(AxisRange range);

/// A number as axis label: "0.5", "20", "1,500", "2 million".
[[nodiscard]] std::string number_text(double value);

class SvgPlot {
  public:
    /// Ranges and labels of the axes. y is logarithmic, x too unless linear_x is set.
    SvgPlot(AxisRange x, AxisRange y, std::string x_label, std::string y_label, bool linear_x = false);

    /// Replaces the numeric ticks of the x axis by labelled ones.
    void set_x_ticks(std::vector<std::pair<double, std::string>> ticks) { x_ticks_ = std::move(ticks); }
    /// A bar from the lower edge of the plot up to y.
    void bar(double x_from, double x_to, double y, const char* css_class);
    /// A polyline through all points, interrupted where y is not positive.
    void line(const std::vector<std::pair<double, double>>& points, const char* css_class);
    /// A filled rectangle of a map, in a CSS colour.
    void cell(AxisRange x, AxisRange y, const std::string& colour);
    /// A small diagonal cross centred on a point.
    void cross(double x, double y);
    /// A vertical line with a label at its upper end.
    void mark(double x, const std::string& label);
    /// An entry of the legend, in the colour of a CSS class.
    void key(const std::string& label, const char* css_class);

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
    std::string body_;  // SVG elements inside the axes
    std::string key_;   // SVG elements of the legend
    double key_x_;      // px, where the next entry of the legend begins
    double last_mark_ = -1e9;
};

}  // namespace haptic::rt
