#include "haptic/plot.hpp"

#include <sstream>
#include <utility>

#include "haptic/external_program.hpp"
#include "haptic/html.hpp"

namespace haptic {
namespace {

/// The last line that is not blank, without indentation: gnuplot's messages end with the reason.
std::string last_line(const std::string& text) {
    std::istringstream lines(text);
    std::string last;
    for (std::string line; std::getline(lines, line);) {
        const std::size_t begin = line.find_first_not_of(" \t\r");
        last = begin == std::string::npos ? last : line.substr(begin);
    }
    return last;
}

void replace_all(std::string& text, std::string_view from, const std::string& to) {
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
        text.replace(at, from.size(), to);
    }
}

/// Removes elements that contain nothing but text.
void remove_elements(std::string& text, const std::string& tag) {
    const std::string end = "</" + tag + ">";
    for (std::size_t at = 0; (at = text.find("<" + tag + ">", at)) != std::string::npos;) {
        const std::size_t last = text.find(end, at);
        text.erase(at, last == std::string::npos ? last : last + end.size() - at);
    }
}

/// An SVG document as element of a page, each of its identifiers beginning with `name`.
std::string inlined(std::string svg, const PlotFigure& figure) {
    svg.erase(0, svg.find("<svg"));
    // A browser shows titles when the pointer rests; gnuplot's name the program and repeat the key.
    remove_elements(svg, "title");
    remove_elements(svg, "desc");
    for (const std::string_view reference : {" id='", " id=\"", "href='#", "href=\"#", "url(#"}) {
        replace_all(svg, reference, std::string(reference) + figure.name + "-");
    }
    return svg.insert(std::string_view("<svg").size(),
                      " role=\"img\" aria-label=\"" + html_text(figure.caption) + "\"");
}

}  // namespace

DrawnPlot draw_plot(const std::string& commands, const std::filesystem::path& folder) {
    // -d: without the user's own settings.
    const ExternalResult result = run_external({"gnuplot", "-d"}, std::string(plot_style()) + commands, folder);
    if (!result.found) {
        return {.svg = "", .problem = "gnuplot is missing"};
    }
    if (!result.succeeded || result.output.find("</svg>") == std::string::npos) {
        return {.svg = "", .problem = "gnuplot failed: " + last_line(result.errors)};
    }
    return {.svg = result.output, .problem = ""};
}

std::string plot_figure(const PlotFigure& figure, const DrawnPlot& plot) {
    std::string text = "<figure class=\"gnuplot\">";
    if (plot.svg.empty()) {
        text += "<p class=\"quiet\">Not drawn: " + html_text(plot.problem) + "." +
                (figure.redraw.empty() ? "" : " " + html_text(figure.redraw)) + "</p>";
    } else {
        text += inlined(plot.svg, figure);
    }
    return text + "<figcaption>" + html_text(figure.caption) + "</figcaption></figure>\n";
}

std::string gnuplot_text(std::string_view text) {
    // In single quotes gnuplot takes every character as it is but the quote, which is doubled.
    std::string quoted = "'";
    for (const char letter : text) {
        quoted += letter == '\'' ? "''" : std::string(1, letter == '\n' || letter == '\r' ? ' ' : letter);
    }
    return quoted + "'";
}

}  // namespace haptic
