#include "measure/plot_commands.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "haptic/plot.hpp"

namespace haptic::rt {

double AxisRange::part(double value) const {
    return std::clamp(std::log(std::max(value, from) / from) / std::log(to / from), 0.0, 0.999999);
}

AxisRange wide_enough(double from, double to) {
    from = std::max(from, 1e-3);
    to = std::max(to, from);
    const double middle = std::sqrt(from * to);
    return {std::min(from, middle / 1.03), std::max(to, middle * 1.03)};
}

std::string plot_number(double value) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.9g", value);
    return text.data();
}

void PlotCommands::log_axis(const std::string& axis, AxisRange range) {
    set("eval log_axis('" + axis + "', " + plot_number(range.from) + ", " + plot_number(range.to) + ")");
}

void PlotCommands::draw(const std::string& rows, const std::string& style, const std::string& name) {
    const std::string block = "$d" + std::to_string(++blocks_);
    data_ += block + " << EOD\n" + rows + "EOD\n";
    plots_ += (plots_.empty() ? "plot " : ", \\\n    ") + block + " " + style +
              (name.empty() ? " notitle" : " title " + gnuplot_text(name));
}

std::string PageFigures::draw(const PlotCommands& plot, const std::string& caption) {
    const std::string name = "plot-" + std::to_string(++count_);
    return plot_figure({.name = name, .caption = caption, .redraw = redraw_}, draw_plot(plot.text()));
}

}  // namespace haptic::rt
