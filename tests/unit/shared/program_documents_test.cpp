#include "documents/program_documents.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "temporary_file.hpp"

namespace haptic {
namespace {

using test::content_of;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::UnorderedElementsAre;

/// A program with one option of each kind.
struct Example {
    Example() {
        app.require_subcommand(1);
        app.add_option("--generate", ignored)->group("");
        CLI::App& run = *app.add_subcommand("run", "Run a scene: it's quick");
        run.add_option("scene", ignored, "A scene")->required();
        run.add_option("--set", many, "Override a key (repeatable)")->type_name("KEY=VALUE")->allow_extra_args(false);
        run.add_option("--clock", ignored, "Pace of the run")->check(CLI::IsMember({"real", "lockstep"}));
        run.add_option("--report", ignored, "Write a report")->type_name("F.json");
        run.add_option("--out", ignored, "Folder")->type_name("DIR");
        run.add_option("--duration", seconds, "Seconds")->capture_default_str();
        run.add_option("--view", ignored, "Show it")->type_name("[ADDR:PORT]")->expected(0, 1);
        run.add_flag("--verify", verify, "Check every step");
        app.add_subcommand("scenes", "List the scenes");
    }
    CLI::App app{"An example.", "my-program"};
    std::string ignored;
    std::vector<std::string> many;
    double seconds = 2.5;
    bool verify = false;
};

ProgramDocuments documents() {
    ProgramDocuments made;
    made.text.summary = "example of a program";
    made.text.see_also = {"other(5)", "third(1)"};
    made.words = {.settings = {"solver.step=", "contact.method=complete", "contact.method=thesis"},
                  .names = {"cloth-drop", "fish-hold"}};
    return made;
}

TEST(CommandText, TakesOptionsFromTheApplicationWithoutHiddenOnes) {
    const Example example;
    const CommandText program = command_text(example.app);
    EXPECT_EQ(program.name, "my-program");
    ASSERT_EQ(program.commands.size(), 2u);
    for (const OptionText& option : program.options) {
        EXPECT_THAT(option.names, Not(Contains("--generate")));
    }
    const auto option = [&program](const std::string& name) {
        for (const OptionText& each : program.commands[0].options) {
            if (each.names[0] == name) {
                return each;
            }
        }
        ADD_FAILURE() << name;
        return OptionText{};
    };
    EXPECT_TRUE(option("scene").positional);
    EXPECT_TRUE(option("scene").required);
    EXPECT_EQ(option("--set").kind, ValueKind::Settings);
    EXPECT_EQ(option("--clock").kind, ValueKind::Words);
    EXPECT_THAT(option("--clock").choices, UnorderedElementsAre("real", "lockstep"));
    EXPECT_EQ(option("--report").kind, ValueKind::File);
    EXPECT_EQ(option("--out").kind, ValueKind::Folder);
    EXPECT_EQ(option("--duration").kind, ValueKind::Other);
    EXPECT_EQ(option("--duration").default_value, "2.5");
    EXPECT_TRUE(option("--view").value_optional);
    EXPECT_EQ(option("--verify").kind, ValueKind::None);
}

TEST(ManPage, NamesEveryCommandAndOption) {
    const Example example;
    const std::string page = program_man_page(command_text(example.app), documents().text);
    EXPECT_THAT(page, HasSubstr(".SH NAME\nmy\\-program \\- example of a program\n"));
    EXPECT_THAT(page, HasSubstr(".SS \"my\\-program run\"\nRun a scene: it's quick.\n"));
    EXPECT_THAT(page, HasSubstr(".BI \"\\-\\-report \" \"F.json\"\nWrite a report.\n"));
    EXPECT_THAT(page, HasSubstr("Seconds. Default: 2.5.\n"));
    EXPECT_THAT(page, HasSubstr(".BR \"other\" \"(5),\"\n.BR \"third\" \"(1)\"\n"));
}

/// What bash offers for a command line whose last word is being typed.
std::vector<std::string> completed(const std::string& script, const std::string& line) {
    // bash-completion's function, for words that are separated by spaces.
    const std::string stub =
        "_get_comp_words_by_ref() { read -r -a line <<<\"$LINE\"; [[ $LINE != *\" \" ]] || line+=(\"\"); "
        "cword=$((${#line[@]} - 1)) cur=${line[cword]} prev=${line[cword - 1]}; }; compopt() { :; }; "
        "COMP_WORDBREAKS=\" =\"\n";
    const std::string command = "LINE='" + line + "' bash -c '" + stub + "source " + script +
                                "; _my_program; printf \"%s\\n\" \"${COMPREPLY[@]}\"'";
    const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
    std::string output;
    for (int c = std::fgetc(pipe.get()); c != EOF; c = std::fgetc(pipe.get())) {
        output += static_cast<char>(c);
    }
    std::vector<std::string> words;
    std::istringstream lines(output);
    for (std::string word; std::getline(lines, word);) {
        words.push_back(word);
    }
    return words;
}

TEST(BashCompletion, OffersCommandsOptionsKeysAndValues) {
    const test::TemporaryDirectory folder;
    const Example example;
    const std::string script =
        folder.write("my-program.bash", bash_completion(command_text(example.app), documents().words)).string();
    EXPECT_THAT(completed(script, "my-program "), AllOf(Contains("run"), Contains("scenes")));
    EXPECT_THAT(completed(script, "my-program ru"), ElementsAre("run"));
    EXPECT_THAT(completed(script, "my-program run --ver"), ElementsAre("--verify"));
    EXPECT_THAT(completed(script, "my-program run fish"), Contains("fish-hold"));
    EXPECT_THAT(completed(script, "my-program run --set solver"), ElementsAre("solver.step="));
    EXPECT_THAT(completed(script, "my-program run --set contact.method=th"), ElementsAre("thesis"));
    EXPECT_THAT(completed(script, "my-program run --clock l"), ElementsAre("lockstep"));
}

TEST(ZshCompletion, DescribesCommandsAndOptions) {
    const Example example;
    const std::string script = zsh_completion(command_text(example.app), documents().words);
    EXPECT_THAT(script, HasSubstr("#compdef my-program\n"));
    EXPECT_THAT(script, HasSubstr("'run:Run a scene: it'\\''s quick'"));
    EXPECT_THAT(script, HasSubstr("'--clock[Pace of the run]:"));
    EXPECT_THAT(script, HasSubstr("compadd -- cloth-drop fish-hold\n"));
}

TEST(FishCompletion, DescribesCommandsAndOptions) {
    const Example example;
    const std::string script = fish_completion(command_text(example.app), documents().words);
    EXPECT_THAT(script,
                HasSubstr("complete -c my-program -n __fish_use_subcommand -a run -d 'Run a scene: it\\'s quick'"));
    EXPECT_THAT(script, HasSubstr("-l clock -x -a '"));
    EXPECT_THAT(script, HasSubstr("-l verify -d 'Check every step'"));
}

TEST(ProgramDocuments, WritesItsFilesWhenAskedToGenerate) {
    const test::TemporaryDirectory folder;
    CLI::App app("An example.", "my-program");
    app.require_subcommand(1);
    app.add_subcommand("run", "Run");
    add_generate_option(app, documents);
    const std::string out = folder.file("documents").string();
    EXPECT_THROW(app.parse("--generate " + out), CLI::Success);
    for (const char* name : {"my-program.1", "my-program.bash", "_my-program", "my-program.fish"}) {
        EXPECT_FALSE(content_of(out + "/" + name).empty()) << name;
    }
}

}  // namespace
}  // namespace haptic
