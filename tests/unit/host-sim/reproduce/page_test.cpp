#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "program/run_program.hpp"
#include "reproduce/study.hpp"

namespace haptic::sim::reproduce {
namespace {

using ::testing::ContainsRegex;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

std::int64_t no_time() {
    return 0;
}

class ReproductionPage : public testing::Test {
  protected:
    ReproductionPage() { std::filesystem::remove_all(folder_); }
    ~ReproductionPage() override { std::filesystem::remove_all(folder_); }

    /// As a process does that makes this figure.
    std::filesystem::path add(const std::string& number, const std::string& title) const {
        const Study study(folder_, no_time);
        Figure figure;
        figure.number = number;
        figure.title = title;
        return study.add_to_page(figure);
    }
    [[nodiscard]] std::string page() const {
        std::ostringstream text;
        text << std::ifstream(folder_ / "index.html").rdbuf();
        return text.str();
    }
    /// Numbers of the page's figures, in order.
    [[nodiscard]] std::vector<std::string> figures() const {
        const std::string text = page();
        const std::string before = "id=\"figure-";
        std::vector<std::string> found;
        for (std::size_t at = text.find(before); at != std::string::npos; at = text.find(before, at + 1)) {
            const std::size_t begin = at + before.size();
            found.push_back(text.substr(begin, text.find('"', begin) - begin));
        }
        return found;
    }

    std::filesystem::path folder_ =
        std::filesystem::path(testing::TempDir()) / ("haptic-page-test-" + std::to_string(getpid()));
};

TEST_F(ReproductionPage, HasTheFiguresOfEarlierRunsInTheOrderOfTheThesis) {
    add("5.9", "a rod");
    EXPECT_EQ(add("4.7", "missed"), folder_ / "index.html");
    add("5.9", "the rod once more");
    EXPECT_THAT(figures(), ElementsAreArray({"4.7", "5.9"}));
    EXPECT_THAT(page(), HasSubstr("Figure 5.9: the rod once more"));
    EXPECT_THAT(page(), Not(HasSubstr("a rod")));
}

TEST_F(ReproductionPage, SaysOfEachFigureWhenItWasMadeAndByWhichVersion) {
    add("4.7", "missed");
    add("5.9", "a rod");
    const std::string text = page();
    const std::size_t second = text.find("id=\"figure-5.9\"");
    ASSERT_NE(second, std::string::npos);
    for (const std::string& section : {text.substr(0, second), text.substr(second)}) {
        EXPECT_THAT(section, ContainsRegex(">Made [0-9]+-[0-9]+-[0-9]+ [0-9]+:[0-9]+ [+-][0-9]+ with host-sim "));
        EXPECT_THAT(section, HasSubstr("with host-sim " + program_version() + "."));
    }
}

TEST_F(ReproductionPage, HasAllFiguresThatAreMadeAtTheSameTime) {
    std::vector<std::string> all;
    for (const Reproduction& which : reproductions()) {
        all.emplace_back(which.number);
    }
    for (int round = 0; round < 20; ++round) {
        std::filesystem::remove_all(folder_);
        std::vector<std::jthread> processes;
        for (const std::string& number : all) {
            processes.emplace_back([this, number] { add(number, "made beside the others"); });
        }
        processes.clear();
        ASSERT_THAT(figures(), ElementsAreArray(all)) << "round " << round;
    }
}

TEST_F(ReproductionPage, NamesAFolderThatWasRemoved) {
    const Study study(folder_, no_time);
    std::filesystem::remove_all(folder_);
    Figure figure;
    figure.number = "4.7";
    try {
        (void)study.add_to_page(figure);
        FAIL() << "wrote to a folder that is not there";
    } catch (const std::runtime_error& error) {
        EXPECT_THAT(error.what(), StartsWith(folder_.string() + ": cannot be locked: No such file"));
    }
}

}  // namespace
}  // namespace haptic::sim::reproduce
