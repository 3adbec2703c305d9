#include "reproduce/study.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <ctime>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include "haptic/external_program.hpp"
#include "haptic/html.hpp"
#include "haptic/plot.hpp"
#include "haptic/text_file.hpp"
#include "program/run_program.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr std::array<Reproduction, 13> kReproductions{{
    {"4.7", false, "Contacts that the detection misses", missed_contacts},
    {"4.13", true, "A cloth dropped from 10 m is caught", cloth_drop},
    {"4.14", false, "Iterations of the pop-out in a fan", pop_out_iterations},
    {"4.15", true, "Computing time of the pop-out", pop_out_times},
    {"4.16", false, "Holding the tail of a living fish", fish_hold},
    {"4.17", false, "Sliding along a fish", fish_slide},
    {"4.18", true, "Four fish: time of each stage", four_fish},
    {"5.5", true, "A deformable hand on a curtain", curtain_hand},
    {"5.6", true, "Time of a step against the number of spheres", sphere_counts},
    {"5.7", false, "Sliding over a plane: dragging forces", plane_slide},
    {"5.8", false, "A hand closes round a fish", fish_grip},
    {"5.9", false, "A thin rod between two spheres", rod_in_gap},
    {"scaling", true, "A step among up to a million triangles, and of scenes of up to 100,000 particles", scaling},
}};

constexpr std::string_view kIntroduction =
    R"(<p>The figures of chapters 4 and 5 of "Haptic Proxy for Dynamic Deformable Objects" (Tokyo Institute of Technology),
reproduced with the scenes built into this program. The thesis' numbers, shown beside ours, were measured on an Intel Core i5-4210U
(1.7 GHz; chapter 5: i5-7300). Ours were measured on one core of the machine on which the figure was
made, at the time and with the version that it names. Where the thesis gives no mass, size or stiffness, the scene's file says
what was chosen. Bodies are moved by the position-based solver of the thesis, also
in scenes that have a material.</p>
)";

std::string now() {
    const std::time_t time = std::time(nullptr);
    std::tm date{};
    localtime_r(&time, &date);
    std::array<char, 32> text{};
    std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M %z", &date);
    return text.data();
}

/// The page's section of one figure.
std::string section_of(const Figure& figure) {
    std::ostringstream out;
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
    out << "</p>\n<p class=\"quiet\">Made " << now() << " with host-sim " << program_version() << ".</p></section>\n";
    return out.str();
}

/// Holds a folder, against other processes that do, from construction to destruction.
class FolderLock {
  public:
    explicit FolderLock(const std::filesystem::path& folder)
        : descriptor_(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
        int error = descriptor_ < 0 ? errno : EINTR;
        while (error == EINTR) {
            error = flock(descriptor_, LOCK_EX) == 0 ? 0 : errno;
        }
        if (error != 0) {
            release();
            throw std::runtime_error(folder.string() + ": cannot be locked: " + std::generic_category().message(error));
        }
    }
    FolderLock(const FolderLock&) = delete;
    FolderLock& operator=(const FolderLock&) = delete;
    ~FolderLock() { release(); }

  private:
    void release() const {
        if (descriptor_ >= 0) {
            close(descriptor_);
        }
    }

    int descriptor_;
};

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

std::filesystem::path Study::add_to_page(const Figure& figure) const {
    const auto section_file = [this](std::string_view number) {
        return folder_ / ("section-" + std::string(number) + ".html");
    };
    // One process at a time, so that the last page has all sections.
    const FolderLock lock(folder_);
    write_text(section_file(figure.number), section_of(figure));
    // The sections that there are, in the order of the thesis.
    const std::filesystem::path file = folder_ / "index.html";
    std::ostringstream out;
    out << page_top("The figures of the thesis, run again") << kIntroduction;
    for (const Reproduction& which : kReproductions) {
        if (const std::ifstream section(section_file(which.number)); section) {
            out << section.rdbuf();
        }
    }
    out << "</body></html>\n";
    write_text(file, out.str());
    return file;
}

}  // namespace haptic::sim::reproduce
