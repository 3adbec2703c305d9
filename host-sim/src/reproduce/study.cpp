#include "reproduce/study.hpp"

#include <array>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "haptic/external_program.hpp"
#include "haptic/html.hpp"
#include "haptic/plot.hpp"
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
    {"scaling", "A step among up to a million triangles, and of scenes of up to 100,000 particles", scaling},
}};

constexpr std::string_view kIntroduction =
    R"(<p>The figures of chapters 4 and 5 of "Haptic Proxy for Dynamic Deformable Objects" (Tokyo Institute of Technology),
reproduced with the scenes built into this program. The thesis' numbers, shown beside ours, were measured on an Intel Core i5-4210U
(1.7 GHz; chapter 5: i5-7300). Ours were measured on one core of the machine on which this page was made. Where the thesis gives no
mass, size or stiffness, the scene's file says what was chosen. Bodies are moved by the position-based solver of the thesis, also
in scenes that have a material.</p>
)";

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
    out << "<div class=\"pictures\">\n";
    for (const std::string& image : figure.images) {
        out << image;
    }
    out << "</div>\n<p>" << html_text(figure.remarks) << "</p>\n<p class=\"quiet\">Data:";
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

void Study::plot(Figure& figure, const std::string& name, const std::string& caption,
                 const std::string& commands) const {
    write_text(folder_ / (name + ".gp"),
               std::string(plot_style()) + "set output " + gnuplot_text(name + ".svg") + "\n" + commands);
    const DrawnPlot drawn = draw_plot(commands, folder_);
    if (!drawn.svg.empty()) {
        write_text(folder_ / (name + ".svg"), drawn.svg);
    }
    figure.images.push_back(plot_figure(
        {.name = name, .caption = caption, .redraw = "Its commands are in " + name + ".gp, its data beside it."},
        drawn));
}

void Study::picture(Figure& figure, const std::string& name, const std::string& caption,
                    const PictureScene& scene) const {
    write_picture_scene(folder_ / (name + ".pov"), scene);
    const ExternalResult result =
        run_external({"povray", "+I" + name + ".pov", "+O" + name + ".png", "+W960", "+H720", "+A", "-D"}, "", folder_);
    write_text(folder_ / (name + ".log"), result.output + result.errors);
    const std::string image = result.succeeded
                                  ? "<img alt=\"" + html_text(caption) + "\" src=\"" + name + ".png\">"
                                  : std::string("<p class=\"quiet\">Not drawn: povray ") +
                                        (result.found ? "failed; " + name + ".log says why" : "is missing") + ".</p>";
    figure.images.push_back("<figure>" + image + "<figcaption>" + html_text(caption) + "</figcaption></figure>\n");
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
