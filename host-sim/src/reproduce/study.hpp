// Output of `host-sim reproduce`: for each figure of the thesis its data, plots, pictures and numbers beside the
// thesis', and one page with all of them.
//
// Data are CSV files, plots gnuplot files, pictures POV-Ray files; all remain in the folder, so that they can be
// inspected or redrawn. If gnuplot or povray is missing, the page says so in place of the image. Each figure's section
// of the page remains, too: a later run, or one beside it, adds its figures to the page of the same folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "reproduce/povray.hpp"

namespace haptic::sim::reproduce {

/// One number of the thesis beside ours.
struct Comparison {
    std::string what;
    std::string thesis;  // "-" if the thesis gives none
    std::string ours;
};

struct Figure {
    std::string number;      // "4.13", as in the thesis; a word for a figure that is not in it
    std::string title;       // what the figure shows
    std::string conditions;  // what was run, and how that differs from the thesis
    std::vector<Comparison> comparisons;
    std::vector<std::string> images;  // plots and pictures, as figures of the page
    std::vector<std::string> data;    // CSV files, in the folder
    std::string remarks;              // what differs in the result, and why
};

/// The output folder.
class Study {
  public:
    /// Creates the folder if necessary. `now` returns monotonic nanoseconds. Throws std::filesystem::filesystem_error.
    Study(std::filesystem::path folder, std::int64_t (*now)());

    /// Registers a data file with the figure and returns its path.
    [[nodiscard]] std::filesystem::path data(Figure& figure, const std::string& name) const;
    /// Draws a plot (haptic/plot.hpp) and adds it to the figure; NAME.gp and NAME.svg remain. `commands` refer to data
    /// files by their bare names and to colours by the line types and quantities of shared/page/plot.gp.
    void plot(Figure& figure, const std::string& name, const std::string& caption, const std::string& commands) const;
    /// Renders a picture with POV-Ray and adds it to the figure.
    void picture(Figure& figure, const std::string& name, const std::string& caption, const PictureScene& scene) const;
    /// Writes the figure's section, and index.html with all sections of the folder; returns the path of the page. Other
    /// processes may do the same. Throws std::runtime_error that names the file.
    std::filesystem::path add_to_page(const Figure& figure) const;

    [[nodiscard]] std::int64_t (*clock() const)() { return clock_; }

  private:
    std::filesystem::path folder_;
    std::int64_t (*clock_)();
};

/// One figure of the thesis and the function that reproduces it.
struct Reproduction {
    const char* number;
    bool measures_times;  // nothing else should run beside it
    const char* title;
    Figure (*make)(const Study& study);
};

/// All figures that can be reproduced, in the order of the thesis.
[[nodiscard]] std::span<const Reproduction> reproductions();

// One function per figure; see reproductions().
[[nodiscard]] Figure missed_contacts(const Study& study);
[[nodiscard]] Figure cloth_drop(const Study& study);
[[nodiscard]] Figure pop_out_iterations(const Study& study);
[[nodiscard]] Figure pop_out_times(const Study& study);
[[nodiscard]] Figure fish_hold(const Study& study);
[[nodiscard]] Figure fish_slide(const Study& study);
[[nodiscard]] Figure four_fish(const Study& study);
[[nodiscard]] Figure curtain_hand(const Study& study);
[[nodiscard]] Figure sphere_counts(const Study& study);
[[nodiscard]] Figure plane_slide(const Study& study);
[[nodiscard]] Figure fish_grip(const Study& study);
[[nodiscard]] Figure rod_in_gap(const Study& study);
[[nodiscard]] Figure scaling(const Study& study);

}  // namespace haptic::sim::reproduce
