// host-sim reproduce: recreates the thesis' figures and tables, beside the thesis' own numbers.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <memory>
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
};

int go(const Options& options) {
    const reproduce::Study study(options.out, monotonic_now_ns);
    const auto selected = [&options](const reproduce::Reproduction& which) {
        return options.figures.empty() || std::ranges::find(options.figures, which.number) != options.figures.end();
    };
    const auto count = std::ranges::count_if(reproduce::reproductions(), selected);
    std::vector<reproduce::Figure> figures;
    for (const reproduce::Reproduction& which : reproduce::reproductions()) {
        if (!selected(which)) {
            continue;
        }
        std::cout << "figure " << which.number << " (" << figures.size() + 1 << " of " << count << "): " << which.title
                  << '\n'
                  << std::flush;
        figures.push_back(which.make(study));
        for (const reproduce::Comparison& c : figures.back().comparisons) {
            std::cout << "    " << c.what << ": " << c.ours << " (thesis: " << c.thesis << ")\n";
        }
    }
    std::cout << "wrote " << study.write_page(figures).string() << '\n';
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
    app.add_option("--out", options->out, "Folder for data, plots, pictures and index.html")
        ->check(result_folder())
        ->capture_default_str();
    return [options] { return go(*options); };
}

}  // namespace haptic::sim
