#include <sys/stat.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstddef>
#include <iostream>
#include <optional>

#include "app/commands.hpp"
#include "app/query_ccd.hpp"
#include "program/progress_bar.hpp"

namespace haptic::sim {
namespace {

/// Size of standard input if it is a file, bytes.
std::optional<double> size_of_input() {
    struct stat status{};
    if (fstat(STDIN_FILENO, &status) != 0 || !S_ISREG(status.st_mode) || status.st_size == 0) {
        return std::nullopt;
    }
    return static_cast<double>(status.st_size);
}

/// Answers standard input. A bar needs an end that is known, and answers that do not go to the same terminal.
int answer_input() {
    const std::optional<double> size = size_of_input();
    if (!size || isatty(STDOUT_FILENO) != 0) {
        return query_ccd(std::cin, std::cout, std::cerr);
    }
    ProgressBar bar("answering queries");
    return query_ccd(std::cin, std::cout, std::cerr,
                     [&](std::size_t bytes) { bar.show(static_cast<double>(bytes) / *size); });
}

}  // namespace

Command add_query_command(CLI::App& app) {
    app.require_subcommand(1);
    app.add_subcommand("ccd",
                       "Read sphere-triangle CCD queries from standard input, 22 numbers per line:\n"
                       "px,py,pz,r, then the corners a,b,c of the triangle at t=0, then at t=1.\n"
                       "Print kind,t_touch,t_centre,nx,ny,nz,qx,qy,qz for each. Exit status 2 if a line is malformed.");
    return answer_input;
}

}  // namespace haptic::sim
