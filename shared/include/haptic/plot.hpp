// Plots of all pages: gnuplot draws them in one style, page/plot.gp, as SVG within the page.
//
// gnuplot is a program of its own, which runs after a measurement and never during one. On a machine without it a page
// is complete in its tables, and in place of each plot it says how to draw the page elsewhere.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace haptic {

/// Style of all plots, page/plot.gp: gnuplot's settings, colours of quantities, and functions for axes.
[[nodiscard]] std::string_view plot_style();

/// A plot, or why there is none.
struct DrawnPlot {
    std::string svg;      // an SVG document; empty if it was not drawn
    std::string problem;  // one line
};

/// Draws with gnuplot in a working folder, where the commands find their data files. The style stands before the
/// commands. Blocks for some tens of milliseconds.
[[nodiscard]] DrawnPlot draw_plot(const std::string& commands, const std::filesystem::path& folder = ".");

/// A plot of a page.
struct PlotFigure {
    std::string name;     // letters, digits, '-' and '.'; unique within the page
    std::string caption;  // text
    std::string redraw;   // text: how to draw the page on another machine; empty: nothing to say
};

/// The plot as a figure of a page, whose identifiers clash with those of no other figure.
[[nodiscard]] std::string plot_figure(const PlotFigure& figure, const DrawnPlot& plot);

/// Text as a string of gnuplot's language, on one line.
[[nodiscard]] std::string gnuplot_text(std::string_view text);

}  // namespace haptic
