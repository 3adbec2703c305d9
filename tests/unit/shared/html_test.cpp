#include "haptic/html.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <regex>
#include <set>

namespace haptic {
namespace {

using testing::HasSubstr;
using testing::IsSupersetOf;

std::set<std::string> names(const std::string& style, const char* pattern) {
    const std::regex expression(pattern);
    std::set<std::string> found;
    for (std::sregex_iterator at(style.begin(), style.end(), expression); at != std::sregex_iterator(); ++at) {
        found.insert((*at)[1]);
    }
    return found;
}

/// Relative luminance of "rrggbb" as WCAG 2.2 defines it.
double luminance(const std::string& colour) {
    constexpr std::array<double, 3> kWeights = {0.2126, 0.7152, 0.0722};
    double sum = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
        const double part = std::stoi(colour.substr(2 * i, 2), nullptr, 16) / 255.0;
        sum += kWeights[i] * (part <= 0.04045 ? part / 12.92 : std::pow((part + 0.055) / 1.055, 2.4));
    }
    return sum;
}

double contrast(const std::string& a, const std::string& b) {
    const auto [less, more] = std::minmax({luminance(a), luminance(b)});
    return (more + 0.05) / (less + 0.05);
}

TEST(Html, TextIsNeverMarkup) {
    EXPECT_EQ(html_text("a <b class=\"x\"> & c"), "a &lt;b class=&quot;x&quot;&gt; &amp; c");
    EXPECT_EQ(html_text("25 µm"), "25 µm");
}

TEST(Html, ATitleIsTextInBothItsPlaces) {
    const std::string top = page_top("late & <later>");
    EXPECT_THAT(top, HasSubstr("<title>late &amp; &lt;later&gt;</title>"));
    EXPECT_THAT(top, HasSubstr("<h1>late &amp; &lt;later&gt;</h1>"));
    EXPECT_THAT(top, HasSubstr(std::string(page_style())));
}

TEST(PageStyle, GivesAValueToEachVariableThatItUses) {
    const std::string style(page_style());
    const auto used = names(style, R"(var\(--([a-z-]+)\))");
    EXPECT_GT(used.size(), 5U);
    EXPECT_THAT(names(style, R"(--([a-z-]+):)"), IsSupersetOf(used));
}

TEST(PageStyle, AsksForNothingFromElsewhere) {
    EXPECT_EQ(page_style().find("url("), std::string_view::npos);
    EXPECT_EQ(page_style().find("@import"), std::string_view::npos);
    EXPECT_EQ(page_style().find('<'), std::string_view::npos) << "it stands between tags";
}

// WCAG 2.2: 4.5 to 1 for text (1.4.3), 3 to 1 for plot lines and the focus indicator (1.4.11).
TEST(PageStyle, CanBeReadOnPaperAndPanelInLightAndInDark) {
    const std::string style(page_style());
    const std::regex expression(R"(--([a-z-]+): light-dark\(#([0-9a-f]{6}), #([0-9a-f]{6})\))");
    std::map<std::string, std::array<std::string, 2>> colours;
    for (std::sregex_iterator at(style.begin(), style.end(), expression); at != std::sregex_iterator(); ++at) {
        colours[(*at)[1]] = {(*at)[2], (*at)[3]};
    }
    const auto expect = [&](const char* front, const char* back, double least) {
        for (const std::size_t shade : {0U, 1U}) {
            EXPECT_GE(contrast(colours.at(front)[shade], colours.at(back)[shade]), least)
                << front << " on " << back << (shade == 0 ? ", light" : ", dark");
        }
    };
    for (const char* back : {"paper", "panel"}) {
        for (const char* text : {"ink", "accent", "warn"}) {
            expect(text, back, 4.5);
        }
        for (const char* line : {"first", "second", "third", "fourth", "focus"}) {
            expect(line, back, 3.0);
        }
    }
    expect("on-accent", "accent", 4.5);
}

}  // namespace
}  // namespace haptic
