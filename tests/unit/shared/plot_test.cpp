#include "haptic/plot.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "haptic/html.hpp"
#include "plot_checks.hpp"

namespace haptic {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

using Colour = std::array<double, 3>;

/// Linear RGB of "rrggbb".
Colour linear(const std::string& text) {
    Colour colour{};
    for (std::size_t i = 0; i < 3; ++i) {
        const double part = std::stoi(text.substr(2 * i, 2), nullptr, 16) / 255.0;
        colour[i] = part <= 0.04045 ? part / 12.92 : std::pow((part + 0.055) / 1.055, 2.4);
    }
    return colour;
}

/// CIE L*a*b* of linear sRGB, white D65.
Colour lab(const Colour& rgb) {
    constexpr std::array<Colour, 3> xyz_from_rgb = {
        {{0.4124, 0.3576, 0.1805}, {0.2126, 0.7152, 0.0722}, {0.0193, 0.1192, 0.9505}}};
    constexpr Colour white = {0.9505, 1.0, 1.089};
    Colour f{};
    for (std::size_t i = 0; i < 3; ++i) {
        double value = 0.0;
        for (std::size_t j = 0; j < 3; ++j) {
            value += xyz_from_rgb[i][j] * std::clamp(rgb[j], 0.0, 1.0) / white[i];
        }
        f[i] = value > 0.008856 ? std::cbrt(value) : 7.787 * value + 16.0 / 116.0;
    }
    return {116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])};
}

/// How a colour looks to people without one kind of cones: Machado et al., A Physiologically-based Model for Simulation
/// of Color Vision Deficiency, 2009, severity 1.
Colour seen(const Colour& rgb, const std::array<Colour, 3>& vision) {
    Colour result{};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) {
            result[i] += vision[i][j] * rgb[j];
        }
    }
    return result;
}
constexpr std::array<std::array<Colour, 3>, 4> kVisions = {
    {{{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}},
     {{{0.152286, 1.052583, -0.204868}, {0.114503, 0.786281, 0.099216}, {-0.003882, -0.048116, 1.051998}}},
     {{{0.367322, 0.860646, -0.227968}, {0.280085, 0.672501, 0.047413}, {-0.011820, 0.042940, 0.968881}}},
     {{{1.255528, -0.076749, -0.178779}, {-0.078411, 0.930809, 0.147602}, {0.004733, 0.691367, 0.303900}}}}};

std::vector<std::string> line_colours() {
    return attribute_values(std::string(plot_style()), "set linetype [1-8] [^\n]*linecolor '#([0-9a-f]{6})'");
}

TEST(PlotStyle, HasEightColoursThatAnyColourVisionTellsApart) {
    const std::vector<std::string> colours = line_colours();
    ASSERT_EQ(colours.size(), 8U);
    for (const auto& vision : kVisions) {
        for (std::size_t i = 0; i < colours.size(); ++i) {
            for (std::size_t j = 0; j < i; ++j) {
                const Colour a = lab(seen(linear(colours[i]), vision));
                const Colour b = lab(seen(linear(colours[j]), vision));
                // A difference (CIE 1976) of 2.3 is just noticeable side by side; lines are thin and apart.
                EXPECT_GE(std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]), 10.0)
                    << colours[i] << " and " << colours[j];
            }
        }
    }
}

TEST(PlotStyle, TakesTheFirstColoursFromThePagesStyle) {
    const std::vector<std::string> page =
        attribute_values(std::string(page_style()), R"(--(?:first|second|third|fourth): light-dark\(#([0-9a-f]{6}))");
    std::vector<std::string> colours = line_colours();
    colours.resize(4);
    EXPECT_EQ(colours, page);
}

// WCAG 2.2, 1.4.11: 3 to 1 for the lines of a plot, on the paper of style.css.
TEST(PlotStyle, StandsOutFromThePaper) {
    const auto luminance = [](const std::string& colour) {
        const Colour c = linear(colour);
        return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
    };
    const double paper =
        luminance(attribute_values(std::string(page_style()), "--paper: light-dark\\(#([0-9a-f]{6})").at(0));
    for (const std::string& colour : line_colours()) {
        EXPECT_GE((paper + 0.05) / (luminance(colour) + 0.05), 3.0) << colour;
    }
}

TEST(Plot, TextIsOneStringOfGnuplot) {
    EXPECT_EQ(gnuplot_text("cyclictest's \"x\"\nplot 1"), "'cyclictest''s \"x\" plot 1'");
}

TEST(Plot, SaysInItsPlaceThatGnuplotIsMissingAndWhatToDo) {
    const NoPrograms none;
    const DrawnPlot plot = draw_plot("plot x\n");
    EXPECT_EQ(plot.svg, "");
    const std::string figure = plot_figure({.name = "p", .caption = "Force & <depth>.", .redraw = "Run <this>."}, plot);
    EXPECT_THAT(figure, AllOf(StartsWith("<figure class=\"gnuplot\">"),
                              HasSubstr("Not drawn: gnuplot is missing. Run &lt;this&gt;."),
                              HasSubstr("Force &amp; &lt;depth&gt;."), Not(HasSubstr("<svg"))));
}

/// Tests that draw.
class GnuplotTest : public testing::Test {
  protected:
    void SetUp() override {
        if (!has_gnuplot()) {
            GTEST_SKIP() << "there is no gnuplot: package gnuplot-nox";
        }
    }

    /// Labels of a plot; a failure of gnuplot is one of the test.
    static std::vector<PlotLabel> labels_of(const std::string& commands) {
        const DrawnPlot plot = draw_plot(commands);
        EXPECT_EQ(plot.problem, "");
        return plot_labels(plot.svg);
    }
    static std::vector<std::string> texts_of(const std::string& commands) {
        std::vector<std::string> texts;
        for (const PlotLabel& label : labels_of(commands)) {
            texts.push_back(label.text);
        }
        return texts;
    }
};

TEST_F(GnuplotTest, KeepsLabelsAtTheEndsOfTheAxesWithinThePicture) {
    const auto labels = labels_of(
        "set xrange [1:10]\nset xtics ('99.9999 %%' 10, 'the first' 1)\nset x2range [1:10]\n"
        "set x2tics ('p99.99' 10)\neval log_axis('y', 0.5, 3e6)\nplot 2 title 'long names of a curve'\n");
    EXPECT_GT(labels.size(), 8U);
    for (const PlotLabel& label : labels) {
        EXPECT_GE(label.from, 0.0) << label.text;
        EXPECT_LE(label.to, kPlotWidth) << label.text;
    }
}

TEST_F(GnuplotTest, LabelsLogarithmicAxesAtOneTwoAndFive) {
    EXPECT_THAT(texts_of("eval log_axis('x', 20, 1500)\nset yrange [0:1]\nplot 0.5 notitle\n"),
                AllOf(Contains("20"), Contains("50"), Contains("100"), Contains("500"), Contains("1,000"),
                      Not(Contains("10")), Not(Contains("2,000"))));
    // Over many decades at the powers of ten only.
    EXPECT_THAT(texts_of("eval log_axis('x', 0.5, 3e6)\nset yrange [0:1]\nplot 0.5 notitle\n"),
                AllOf(Contains("10"), Contains("1 million"), Not(Contains("20"))));
}

TEST_F(GnuplotTest, LabelsARangeOfLessThanADecadeEvenly) {
    const auto texts = texts_of("eval log_axis('x', 980, 1020)\nset yrange [2:3]\nplot 2.5 notitle\n");
    EXPECT_THAT(texts, AllOf(Contains("990"), Contains("1000"), Contains("1010")));
}

TEST_F(GnuplotTest, GivesEachFigureOfAPageItsOwnIdentifiers) {
    const DrawnPlot plot = draw_plot("set key\nplot x with points pointtype 7, 2*x with linespoints pointtype 5\n");
    const std::string page = plot_figure({.name = "a", .caption = "A.", .redraw = ""}, plot) +
                             plot_figure({.name = "b", .caption = "B.", .redraw = ""}, plot);
    const auto ids = attribute_values(page, " id=['\"]([^'\"]*)");
    const std::set<std::string> unique(ids.begin(), ids.end());
    EXPECT_GT(ids.size(), 20U);
    EXPECT_EQ(unique.size(), ids.size());
    // Every reference has its target.
    const auto references = attribute_values(page, "(?:href=['\"]#|url\\(#)([^'\")]*)");
    EXPECT_GT(references.size(), 4U);
    for (const std::string& reference : references) {
        EXPECT_THAT(ids, Contains(reference));
    }
    EXPECT_THAT(page, AllOf(Not(HasSubstr("<title>")), Not(HasSubstr("<desc>")), Not(HasSubstr("<?xml"))));
}

TEST_F(GnuplotTest, SaysWhyGnuplotFailed) {
    const DrawnPlot plot = draw_plot("plot 'no-such-file.csv' using 1:2\n");
    EXPECT_EQ(plot.svg, "");
    EXPECT_THAT(plot.problem, AllOf(StartsWith("gnuplot failed: "), Not(HasSubstr("\n"))));
}

TEST_F(GnuplotTest, FindsDataInTheFolderAndIgnoresTheUsersSettings) {
    const auto folder = std::filesystem::temp_directory_path() / ("plot_test." + std::to_string(getpid()));
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "data.csv") << "t,f\n1,2\n3,4\n";
    std::ofstream(folder / ".gnuplot") << "exit\n";
    const char* const before = std::getenv("HOME");
    const std::string home = before != nullptr ? before : "/";
    setenv("HOME", folder.c_str(), 1);
    const DrawnPlot plot = draw_plot("plot 'data.csv' using 't':'f' with lines title 'a_b^c'\n", folder);
    setenv("HOME", home.c_str(), 1);
    std::filesystem::remove_all(folder);
    EXPECT_EQ(plot.problem, "");
    EXPECT_THAT(plot.svg, HasSubstr("a_b^c"));
}

}  // namespace
}  // namespace haptic
