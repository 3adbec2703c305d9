// host-sim reproduce: recreates the thesis' figures and tables, beside the thesis' own numbers.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "app/commands.hpp"
#include "haptic/clock.hpp"
#include "program/option_checks.hpp"
#include "reproduce/study.hpp"

namespace haptic::sim {
namespace {

struct Options {
    std::vector<std::string> figures;
    std::string out = "reproduction";
    bool list = false;
};

/// A line for each figure: number, what it shows, which tells whether it may run beside others, and title.
std::string figure_list() {
    std::ostringstream lines;
    for (const reproduce::Reproduction& which : reproduce::reproductions()) {
        lines << std::left << std::setw(9) << which.number << std::setw(9)
              << (which.measures_times ? "times" : "results") << which.title << '\n';
    }
    return lines.str();
}

int go(const Options& options) {
    if (options.list) {
        std::cout << figure_list();
        return 0;
    }
    const reproduce::Study study(options.out, monotonic_now_ns);
    const auto selected = [&options](const reproduce::Reproduction& which) {
        return options.figures.empty() || std::ranges::find(options.figures, which.number) != options.figures.end();
    };
    const auto count = std::ranges::count_if(reproduce::reproductions(), selected);
    std::ptrdiff_t made = 0;
    std::filesystem::path page;
    for (const reproduce::Reproduction& which : reproduce::reproductions()) {
        if (!selected(which)) {
            continue;
        }
        std::cout << "figure " << which.number << " (" << ++made << " of " << count << "): " << which.title << '\n'
                  << std::flush;
        const reproduce::Figure figure = which.make(study);
        for (const reproduce::Comparison& c : figure.comparisons) {
            std::cout << "    " << c.what << ": " << c.ours << " (thesis: " << c.thesis << ")\n";
        }
        page = study.add_to_page(figure);
    }
    std::cout << "wrote " << page.string() << '\n';
    return 0;
}

}  // namespace

Command add_reproduce_command(CLI::App& app) {
    const auto options = std::make_shared<Options>();
    std::vector<std::string> known;
    std::string described = "Figures of chapters 4 and 5 to reproduce; default: all. Available:";
    for (const reproduce::Reproduction& which : reproduce::reproductions()) {
        known.emplace_back(which.number);
        described += std::string("\n  ") + which.number + "  " + which.title;
    }
    app.add_option("figure", options->figures, described)->check(CLI::IsMember(known));
    app.add_option("--out", options->out,
                   "Folder for data, plots, pictures and index.html, which shows all figures that the folder has")
        ->check(result_folder())
        ->capture_default_str();
    app.add_flag("--list", options->list,
                 "Print the figures, and which measure times, so that nothing else should run beside them");
    return [options] { return go(*options); };
}

}  // namespace haptic::sim
