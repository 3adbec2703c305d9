#include "reproduce/study.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "haptic/html.hpp"
#include "haptic/text_file.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr std::array<Reproduction, 13> kReproductions{{
    {"4.7", "Contacts that the detection misses", missed_contacts},
    {"4.13", "A cloth dropped from 10 m is caught", cloth_drop},
    {"4.14", "Iterations of the pop-out in a fan", pop_out_iterations},
    {"4.15", "Computing time of the pop-out", pop_out_times},
    {"4.16", "Holding the tail of a living fish", fish_hold},
    {"4.17", "Sliding along a fish", fish_slide},
    {"4.18", "Four fish: time of each stage", four_fish},
    {"5.5", "A deformable hand on a curtain", curtain_hand},
    {"5.6", "Time of a step against the number of spheres", sphere_counts},
    {"5.7", "Sliding over a plane: dragging forces", plane_slide},
    {"5.8", "A hand closes round a fish", fish_grip},
    {"5.9", "A thin rod between two spheres", rod_in_gap},
    {"scaling", "A step among up to a million triangles", scaling},
}};

// Style of all plots. Line types: 1 ours, 2 the thesis (red), 3 green, 4 ochre, 5 grey, 6 violet, 7 light blue, 8 dark
// grey.
constexpr std::string_view kPlotPreamble =
    R"(set terminal svg size 760,340 dynamic font 'sans-serif,13'
set datafile separator comma
set grid linecolor '#dddddd'
set border 3 linecolor '#666666'
set linetype 1 linewidth 1.5 linecolor '#2a6f97'
set linetype 2 linewidth 1.5 linecolor '#c8553d'
set linetype 3 linewidth 1.5 linecolor '#5f8744'
set linetype 4 linewidth 1.5 linecolor '#b3710f'
set linetype 5 linewidth 1.5 linecolor '#999999'
set linetype 6 linewidth 1.5 linecolor '#8a6fb0'
set linetype 7 linewidth 1.5 linecolor '#8ab6cf'
set linetype 8 linewidth 1.5 linecolor '#555555'
set tics nomirror
set key outside top center horizontal
)";

constexpr std::string_view kIntroduction =
    R"(<p>The figures of chapters 4 and 5 of "Haptic Proxy for Dynamic Deformable Objects" (Tokyo Institute of Technology),
reproduced with the scenes built into this program. The thesis' numbers, shown beside ours, were measured on an Intel Core i5-4210U
(1.7 GHz; chapter 5: i5-7300). Ours were measured on one core of the machine on which this page was made. Where the thesis gives no
mass, size or stiffness, the scene's file says what was chosen.</p>
)";

void write_images(std::ostream& out, const Figure& figure) {
    out << "<div class=\"pictures\">\n";
    for (const Image& image : figure.images) {
        out << (image.file.ends_with(".svg") ? "<figure class=\"gnuplot\">" : "<figure>");
        if (image.file.empty()) {
            out << "<p class=\"quiet\">(not drawn: gnuplot or povray is missing or has failed)</p>";
        } else {
            out << "<img alt=\"" << html_text(image.caption) << "\" src=\"" << image.file << "\">";
        }
        out << "<figcaption>" << html_text(image.caption) << "</figcaption></figure>\n";
    }
    out << "</div>\n";
}

void write_figure(std::ostream& out, const Figure& figure) {
    const bool numbered = !figure.number.empty() && figure.number[0] >= '0' && figure.number[0] <= '9';
    out << "<section><h2 id=\"figure-" << figure.number << "\">" << (numbered ? "Figure " : "Additional: ")
        << figure.number << ": " << html_text(figure.title) << "</h2>\n<p>" << html_text(figure.conditions) << "</p>\n";
    // Numbers of the thesis beside ours, then the images and links to the data.
    if (!figure.comparisons.empty()) {
        out << "<table><tr><th></th><th>thesis</th><th>here</th></tr>\n";
        for (const Comparison& c : figure.comparisons) {
            out << "<tr><td>" << html_text(c.what) << "</td><td>" << html_text(c.thesis) << "</td><td>"
                << html_text(c.ours) << "</td></tr>\n";
        }
        out << "</table>\n";
    }
    write_images(out, figure);
    out << "<p>" << html_text(figure.remarks) << "</p>\n<p class=\"quiet\">Data:";
    for (const std::string& file : figure.data) {
        out << " <a href=\"" << file << "\">" << file << "</a>";
    }
    out << "</p></section>\n";
}

}  // namespace

std::span<const Reproduction> reproductions() {
    return kReproductions;
}

Study::Study(std::filesystem::path folder, std::int64_t (*now)()) : folder_(std::move(folder)), clock_(now) {
    std::filesystem::create_directories(folder_);
}

std::filesystem::path Study::data(Figure& figure, const std::string& name) const {
    figure.data.push_back(name + ".csv");
    return folder_ / figure.data.back();
}

bool Study::run(const std::vector<std::string>& command, const std::string& name) const {
    // posix_spawnp wants an argument list that ends with null.
    std::vector<char*> arguments;
    arguments.reserve(command.size() + 1);
    for (const std::string& word : command) {
        arguments.push_back(const_cast<char*>(word.c_str()));  // posix_spawnp does not write to them
    }
    arguments.push_back(nullptr);
    // No input; output to NAME.log; working directory: the folder.
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    const std::string log = (folder_ / (name + ".log")).string();
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
    posix_spawn_file_actions_addchdir_np(&actions, folder_.c_str());
    pid_t child = 0;
    const int refused = posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (refused != 0) {
        return false;
    }
    // Wait for the program, also across signals.
    int status = 0;
    while (waitpid(child, &status, 0) < 0) {
        if (errno != EINTR) {
            return false;
        }
    }
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

void Study::plot(Figure& figure, const std::string& name, const std::string& caption,
                 const std::string& commands) const {
    write_text(folder_ / (name + ".gp"), std::string(kPlotPreamble) + "set output '" + name + ".svg'\n" + commands);
    const bool drawn = run({"gnuplot", name + ".gp"}, name);
    figure.images.push_back({drawn ? name + ".svg" : "", caption});
}

void Study::picture(Figure& figure, const std::string& name, const std::string& caption,
                    const PictureScene& scene) const {
    write_picture_scene(folder_ / (name + ".pov"), scene);
    const bool drawn = run({"povray", "+I" + name + ".pov", "+O" + name + ".png", "+W960", "+H720", "+A", "-D"}, name);
    figure.images.push_back({drawn ? name + ".png" : "", caption});
}

std::filesystem::path Study::write_page(std::span<const Figure> figures) const {
    const std::filesystem::path file = folder_ / "index.html";
    std::ostringstream out;
    out << page_top("The figures of the thesis, run again") << kIntroduction;
    for (const Figure& figure : figures) {
        write_figure(out, figure);
    }
    out << "</body></html>\n";
    write_text(file, out.str());
    return file;
}

}  // namespace haptic::sim::reproduce
