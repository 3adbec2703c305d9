#include <CLI/CLI.hpp>
#include <iostream>

#include "app/commands.hpp"
#include "app/query_ccd.hpp"

namespace haptic::sim {

Command add_query_command(CLI::App& app) {
    app.require_subcommand(1);
    app.add_subcommand("ccd",
                       "Read sphere-triangle CCD queries from standard input, 22 numbers per line:\n"
                       "px,py,pz,r, then the corners a,b,c of the triangle at t=0, then at t=1.\n"
                       "Print kind,t_touch,t_centre,nx,ny,nz,qx,qy,qz for each. Exit status 2 if a line is malformed.");
    return [] { return query_ccd(std::cin, std::cout, std::cerr); };
}

}  // namespace haptic::sim
