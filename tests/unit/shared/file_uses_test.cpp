#include "program/file_uses.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <stdexcept>
#include <string>

#include "temporary_file.hpp"

namespace haptic {
namespace {

using test::message_of;
using test::TemporaryDirectory;

/// Problem of a command that reads one file and writes another.
std::string problem_of(const std::filesystem::path& read, const std::filesystem::path& written) {
    FileUses files;
    files.reads("--in ", read);
    files.writes("--out ", written);
    return message_of<std::invalid_argument>([&files] { files.require_distinct(); });
}

TEST(FileUses, NamesBothOptionsAndTheFile) {
    EXPECT_EQ(problem_of("a.csv", "a.csv"),
              "--out a.csv would write a.csv, which --in a.csv reads: choose another name");
    FileUses files;
    files.also_reads("--device replay:run.csv", "run.frames.csv");
    files.also_writes("--record run.new", "run.frames.csv");
    EXPECT_EQ(message_of<std::invalid_argument>([&files] { files.require_distinct(); }),
              "--record run.new would also write run.frames.csv, which --device replay:run.csv also reads: choose "
              "another name");
}

TEST(FileUses, RecognisesOneFileUnderTwoNames) {
    const TemporaryDirectory folder;
    const std::filesystem::path file = folder.write("a.csv", "1\n");
    std::filesystem::create_symlink(file, folder.file("symbolic.csv"));
    std::filesystem::create_hard_link(file, folder.file("hard.csv"));
    std::filesystem::create_directory_symlink(folder.path(), folder.file("here"));
    for (const std::filesystem::path& same :
         {folder.file("symbolic.csv"), folder.file("hard.csv"), folder.path() / "." / "a.csv"}) {
        EXPECT_NE(problem_of(file, same), "") << same;
    }
    // Files that do not exist yet, in one folder under two names.
    EXPECT_NE(problem_of(folder.file("new.csv"), folder.file("here") / "new.csv"), "");
    EXPECT_EQ(problem_of(file, folder.file("b.csv")), "");
}

TEST(FileUses, LetsOptionsShareWhatKeepsNothingAndWhatIsOnlyRead) {
    const TemporaryDirectory folder;
    ASSERT_EQ(mkfifo(folder.file("pipe").c_str(), 0600), 0);
    EXPECT_EQ(problem_of("/dev/null", "/dev/null"), "");
    EXPECT_EQ(problem_of(folder.file("pipe"), folder.file("pipe")), "");
    EXPECT_EQ(problem_of("", ""), "");
    FileUses files;
    files.reads("--in ", "a.csv");
    files.also_reads("--other b.csv", "a.csv");
    EXPECT_NO_THROW(files.require_distinct());
}

}  // namespace
}  // namespace haptic
