// What tests of plots share: the texts of a drawn plot, and a machine without gnuplot.
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "haptic/external_program.hpp"

namespace haptic {

inline bool has_gnuplot() {
    return run_external({"gnuplot", "--version"}, "", "/").succeeded;
}

/// A text of a plot and the pixels that it covers horizontally, in the SVG's own coordinates.
struct PlotLabel {
    std::string text;
    double from = 0.0;
    double to = 0.0;
};

/// Width of the plots of page/plot.gp, px.
inline constexpr double kPlotWidth = 720.0;

/// The horizontal texts of all plots of a page or of one SVG document.
inline std::vector<PlotLabel> plot_labels(const std::string& svg) {
    constexpr double letter = 8.3;  // px: a digit of DejaVu Sans, a wide font, at 13 px
    const std::regex expression(
        R"re(<g transform="translate\(([0-9.-]+),[0-9.-]+\)"[^>]*text-anchor="(\w+)">\s*<text>(?:<tspan[^>]*>)?([^<]*)<)re");
    std::vector<PlotLabel> labels;
    for (std::sregex_iterator at(svg.begin(), svg.end(), expression); at != std::sregex_iterator(); ++at) {
        std::string text = (*at)[3];
        text.erase(0, text.find_first_not_of(' '));
        const double x = std::stod((*at)[1]);
        const double width = letter * static_cast<double>(text.size());
        const double from = (*at)[2] == "end" ? x - width : (*at)[2] == "middle" ? x - 0.5 * width : x;
        labels.push_back({text, from, from + width});
    }
    return labels;
}

/// The values of an attribute, in order.
inline std::vector<std::string> attribute_values(const std::string& page, const std::string& pattern) {
    const std::regex expression(pattern);
    std::vector<std::string> values;
    for (std::sregex_iterator at(page.begin(), page.end(), expression); at != std::sregex_iterator(); ++at) {
        values.push_back((*at)[1]);
    }
    return values;
}

/// While it lives no program is found, as if none were installed.
class NoPrograms {
  public:
    NoPrograms() : path_(std::getenv("PATH") != nullptr ? std::getenv("PATH") : "") { setenv("PATH", "/nowhere", 1); }
    NoPrograms(const NoPrograms&) = delete;
    NoPrograms& operator=(const NoPrograms&) = delete;
    ~NoPrograms() { setenv("PATH", path_.c_str(), 1); }

  private:
    std::string path_;
};

}  // namespace haptic
