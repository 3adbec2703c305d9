#include "haptic/csv.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <bit>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <limits>
#include <random>

#include "temporary_file.hpp"

namespace haptic {
namespace {

using test::content_of;
using test::message_of;
using test::TemporaryDirectory;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;

std::string load_error(std::string_view content) {
    const TemporaryDirectory directory;
    const auto file = directory.write("f.csv", content);
    const std::string message = message_of<CsvError>([&] { static_cast<void>(CsvTable::load(file)); });
    EXPECT_THAT(message, testing::StartsWith(file.string() + ":"));
    return message.substr(std::min(message.size(), file.string().size() + 1));
}

TEST(Csv, ReadsBackTheSameBits) {
    const TemporaryDirectory directory;
    std::mt19937_64 random(3);
    std::vector<double> written{0.0,
                                -0.0,
                                0.1,
                                1.0 / 3.0,
                                1e-300,
                                -1e300,
                                std::numeric_limits<double>::denorm_min(),
                                std::numeric_limits<double>::max()};
    while (written.size() < 3000) {
        const double value = std::bit_cast<double>(random());
        if (std::isfinite(value)) {
            written.push_back(value);
        }
    }
    CsvWriter writer(directory.file("bits.csv"), {"a", "b", "c"});
    for (std::size_t i = 0; i < written.size(); i += 3) {
        writer.row(std::span(written).subspan(i, 3));
    }
    writer.close();
    const CsvTable table = CsvTable::load(directory.file("bits.csv"));
    ASSERT_EQ(table.rows(), written.size() / 3);
    for (std::size_t i = 0; i < written.size(); ++i) {
        const double read = table.column(table.columns()[i % 3])[i / 3];
        ASSERT_EQ(std::bit_cast<std::uint64_t>(read), std::bit_cast<std::uint64_t>(written[i])) << written[i];
    }
}

TEST(Csv, TakesWhatSpreadsheetsWrite) {
    const TemporaryDirectory directory;
    const auto file = directory.write("f.csv", "\xEF\xBB\xBFtime_s, x_m\r\n0, +1.5\r\n\r\n1e-3,\t-2\r\n");
    const CsvTable table = CsvTable::load(file);
    EXPECT_THAT(table.columns(), ElementsAre("time_s", "x_m"));
    EXPECT_THAT(table.column("time_s"), ElementsAre(0.0, 1e-3));
    EXPECT_THAT(table.column("x_m"), ElementsAre(1.5, -2.0));
    EXPECT_FALSE(table.find("y_m").has_value());
}

TEST(Csv, NamesTheLineOfWhatIsWrong) {
    EXPECT_THAT(load_error(""), HasSubstr("1: the first line must name the columns"));
    EXPECT_THAT(load_error("1,2\n3,4\n"), HasSubstr("1: the first line must name the columns"));
    EXPECT_EQ(load_error("a,b,a\n"), "1: two columns are named \"a\"");
    EXPECT_EQ(load_error("a,b\n1,2\n3\n"), "3: has 1 cells, the header has 2");
    EXPECT_EQ(load_error("a,b\n1,2\n\n3,4,5\n"), "4: has 3 cells, the header has 2");
    EXPECT_EQ(load_error("a,b\n1,nan\n"), "2: column b: \"nan\" is not a finite number");
    EXPECT_EQ(load_error("a,b\ninf,0\n"), "2: column a: \"inf\" is not a finite number");
    EXPECT_EQ(load_error("a,b\n1,\n"), "2: column b: \"\" is not a finite number");
    EXPECT_EQ(load_error("a,b\n1,2x\n"), "2: column b: \"2x\" is not a finite number");
    EXPECT_EQ(load_error("a,b\n1,1e999\n"), "2: column b: \"1e999\" is not a finite number");
}

TEST(Csv, KeepsNotesBeforeTheHeaderAndBetweenTheRows) {
    const TemporaryDirectory directory;
    CsvWriter writer(directory.file("notes.csv"), {"a", "b"}, {"scene cloth-drop", "set x=1"});
    writer.row(std::vector<double>{1.0, 2.0});
    writer.close();
    EXPECT_EQ(content_of(directory.file("notes.csv")), "# scene cloth-drop\n# set x=1\na,b\n1,2\n");
    const CsvTable table = CsvTable::load(directory.file("notes.csv"));
    EXPECT_THAT(table.notes(), ElementsAre("scene cloth-drop", "set x=1"));
    EXPECT_EQ(table.header_line(), 3u);
    EXPECT_EQ(table.rows(), 1u);
    const CsvTable by_hand = CsvTable::load(directory.write("f.csv", "#one\r\na\n1\n  # two, with a comma\n2\n"));
    EXPECT_THAT(by_hand.notes(), ElementsAre("one", "two, with a comma"));
    EXPECT_THAT(by_hand.column("a"), ElementsAre(1.0, 2.0));
    EXPECT_THAT(load_error("# only a note\n"), HasSubstr("must name the columns"));
    EXPECT_THAT(load_error("# a note\na,b\n1\n"), testing::StartsWith("3: has 1 cells"));
}

TEST(Csv, ListsTheColumnsThatThereAreWhenOneIsMissed) {
    const TemporaryDirectory directory;
    const CsvTable table = CsvTable::load(directory.write("f.csv", "time_s,x_m\n"));
    EXPECT_EQ(table.rows(), 0u);
    EXPECT_THAT(message_of<CsvError>([&] { static_cast<void>(table.column("y_m")); }),
                EndsWith("f.csv:1: there is no column y_m; the file has: time_s, x_m"));
}

TEST(Csv, NamesTheFileThatCannotBeRead) {
    EXPECT_EQ(message_of<CsvError>([] { static_cast<void>(CsvTable::load("/nonexistent/f.csv")); }),
              "/nonexistent/f.csv: cannot be read: No such file or directory");
    EXPECT_EQ(message_of<CsvError>([] { static_cast<void>(CsvTable::load("/")); }),
              "/: cannot be read: is a directory");
}

TEST(CsvReader, KeepsAllBitsOfIntegers) {
    const TemporaryDirectory directory;
    const auto file = directory.file("f.csv");
    CsvWriter writer(file, {"signed", "unsigned", "real"});
    writer.row(
        std::vector<CsvCell>{std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::uint64_t>::max(), 0.1});
    writer.row(std::vector<CsvCell>{std::int64_t{9'007'199'254'740'993}, std::uint64_t{0}, -0.0});
    writer.close();
    CsvReader reader(file);
    ASSERT_TRUE(reader.next());
    EXPECT_EQ(reader.integer(0), std::numeric_limits<std::int64_t>::min());
    EXPECT_EQ(reader.natural(reader.index("unsigned")), std::numeric_limits<std::uint64_t>::max());
    EXPECT_EQ(reader.number(2), 0.1);
    ASSERT_TRUE(reader.next());
    EXPECT_EQ(reader.integer(0), 9'007'199'254'740'993) << "no double is this number";
    EXPECT_TRUE(std::signbit(reader.number(2)));
    EXPECT_EQ(reader.cell(2), "-0");
    EXPECT_FALSE(reader.next());
}

TEST(CsvReader, SaysHowMuchOfTheFileItHasRead) {
    const TemporaryDirectory directory;
    CsvReader reader(directory.write("f.csv", "time_s\n0\n1\n2\n3\n"));
    double share = reader.share();
    EXPECT_GT(share, 0.0);
    while (reader.next()) {
        EXPECT_GT(reader.share(), share);
        share = reader.share();
    }
    EXPECT_EQ(share, 1.0);
}

TEST(CsvReader, NamesTheLineOfWhatIsNoInteger) {
    const TemporaryDirectory directory;
    CsvReader reader(directory.write("f.csv", "a,b\n\n1.5,-1\n"));
    ASSERT_TRUE(reader.next());
    EXPECT_THAT(message_of<CsvError>([&] { static_cast<void>(reader.integer(0)); }),
                EndsWith("f.csv:3: column a: \"1.5\" is not an integer of 64 bits"));
    EXPECT_THAT(message_of<CsvError>([&] { static_cast<void>(reader.natural(1)); }),
                EndsWith("f.csv:3: column b: \"-1\" is not a natural number of 64 bits"));
    EXPECT_THAT(message_of<CsvError>([&] { static_cast<void>(reader.index("c")); }),
                EndsWith("f.csv:1: there is no column c; the file has: a, b"));
}

TEST(CsvWriter, LeavesTheOldFileUntilTheNewOneIsWhole) {
    const TemporaryDirectory directory;
    const auto file = directory.write("f.csv", "old");
    {
        CsvWriter writer(file, {"a"});
        writer.row(std::vector{1.0});
        EXPECT_EQ(content_of(file), "old");
        writer.close();
    }
    EXPECT_EQ(content_of(file), "a\n1\n");
    EXPECT_EQ(directory.entries(), 1u);
}

TEST(CsvWriter, LeavesNothingBehindWhenItIsNotClosed) {
    const TemporaryDirectory directory;
    {
        CsvWriter writer(directory.file("f.csv"), {"a"});
        writer.row(std::vector{1.0});
    }
    EXPECT_EQ(directory.entries(), 0u);
}

TEST(CsvWriter, RefusesRowsOfAnotherWidth) {
    const TemporaryDirectory directory;
    CsvWriter writer(directory.file("f.csv"), {"a", "b"});
    EXPECT_THROW(writer.row(std::vector{1.0}), CsvError);
}

TEST(CsvWriter, SaysThatItCannotWrite) {
    EXPECT_EQ(message_of<std::runtime_error>([] { CsvWriter("/nonexistent/f.csv", {"a"}).close(); }),
              "/nonexistent/f.csv: cannot be written: No such file or directory");
}

TEST(CsvWriter, ReportsAFullDisk) {
    CsvWriter writer("/dev/full", {"a"});  // not a regular file: written directly, and every write fails
    EXPECT_EQ(message_of<std::runtime_error>([&] { writer.close(); }),
              "/dev/full: cannot be written: No space left on device");
}

TEST(CsvStream, LeavesTheRowsOfARunThatNeverClosesIt) {
    const TemporaryDirectory directory;
    const auto file = directory.write("f.csv", "old");
    CsvStream stream(file, {"a"});
    stream.row(std::vector<CsvCell>{1.0});
    EXPECT_TRUE(stream.flush());
    stream.row(std::vector<CsvCell>{2.0});
    EXPECT_EQ(content_of(file), "a\n1\n");  // the second row was not flushed
}

TEST(CsvStream, ReportsAFullDiskOnlyAtItsEnd) {
    CsvStream stream("/dev/full", {"a"});
    stream.row(std::vector<CsvCell>{1.0});
    EXPECT_FALSE(stream.flush());
    EXPECT_FALSE(stream.flush());
    EXPECT_EQ(message_of<std::runtime_error>([&] { stream.close(); }),
              "/dev/full: could not be written completely: No space left on device; its first 0 bytes are kept");
}

TEST(StreamedFile, EndsAfterTheLastLineThatFits) {
    const TemporaryDirectory directory;
    // A limit of the process stands for a full disk: the second write fits in part.
    rlimit before{};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto ignored = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit few{9, before.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &few), 0);
    StreamedFile stream(directory.file("f"));
    const bool first = stream.append("12\n");
    const bool second = stream.append("4567\n9\n");
    const bool third = stream.append("3");
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
    std::signal(SIGXFSZ, ignored);
    EXPECT_TRUE(first);
    EXPECT_FALSE(second);
    EXPECT_FALSE(third);
    EXPECT_THAT(message_of<std::runtime_error>([&] { stream.close(); }), HasSubstr("its first 8 bytes are kept"));
    EXPECT_EQ(content_of(directory.file("f")), "12\n4567\n");
}

TEST(CsvReader, SkipsALastLineThatAKilledRunLeftIncomplete) {
    const TemporaryDirectory directory;
    CsvReader reader(directory.write("f.csv", "a,b\n1,2\n# note\n3,4\n5"));
    EXPECT_TRUE(reader.next());
    EXPECT_TRUE(reader.next());
    EXPECT_EQ(reader.number(1), 4.0);
    EXPECT_FALSE(reader.next());
    EXPECT_THAT(reader.notes(), ElementsAre("note"));
    // With its line end, it is an error as before.
    CsvReader whole(directory.write("g.csv", "a,b\n5\n"));
    EXPECT_THROW((void)whole.next(), CsvError);
}

}  // namespace
}  // namespace haptic
