// Commands of gnuplot for one plot, with its data: what the pages of `rt-core measure` and `rt-core stability` hand to
// haptic/plot.hpp.
#pragma once

#include <string>

namespace haptic::rt {

/// Range of an axis, in the unit of the plotted quantity; both ends are positive.
struct AxisRange {
    double from = 1.0;
    double to = 10.0;

    /// Position of a value between the logarithms of the ends: from 0 to less than 1.
    [[nodiscard]] double part(double value) const;
};

/// The range, made positive and at least a few per cent wide.
[[nodiscard]] AxisRange wide_enough(double from, double to);

/// A number for gnuplot, without a comma.
[[nodiscard]] std::string plot_number(double value);
/// A line of a block of data; a NaN is no value.
template <class... More>
[[nodiscard]] std::string plot_row(double first, More... more) {
    std::string row = plot_number(first);
    ((row += "," + plot_number(more)), ...);
    return row + "\n";
}

class PlotCommands {
  public:
    /// Commands before the plot, such as "set xlabel 'us'".
    void set(const std::string& command) { settings_ += command + "\n"; }
    /// A logarithmic axis ("x", "y", "x2"), or a linear one if the range is less than a decade.
    void log_axis(const std::string& axis, AxisRange range);
    /// Draws rows of data in a style of gnuplot's, for example "using 1:2 with lines". A blank row interrupts a line.
    /// An empty name is left out of the key.
    void draw(const std::string& rows, const std::string& style, const std::string& name);

    [[nodiscard]] std::string text() const { return data_ + settings_ + plots_ + "\n"; }

  private:
    std::string data_;  // blocks $d1, $d2, ...
    std::string settings_;
    std::string plots_;
    int blocks_ = 0;
};

/// The figures of one page: draws each one, or says in its place how to redraw the page on a machine with gnuplot.
class PageFigures {
  public:
    explicit PageFigures(std::string redraw) : redraw_(std::move(redraw)) {}

    [[nodiscard]] std::string draw(const PlotCommands& plot, const std::string& caption);

  private:
    std::string redraw_;
    int count_ = 0;
};

}  // namespace haptic::rt
