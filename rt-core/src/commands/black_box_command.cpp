#include "commands/black_box_command.hpp"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdio>
#include <stdexcept>

#include "commands/run_command.hpp"
#include "measure/recording.hpp"
#include "program/exit_status.hpp"
#include "program/file_uses.hpp"
#include "tick/recorder.hpp"

namespace haptic::rt {
namespace {

// The guard of a run that was killed needs less.
constexpr double kGuardSavesSeconds = 3.0;

}  // namespace

std::optional<std::filesystem::path> save_black_box(LeftBlackBox left) {
    const BlackBox box(left.memory);
    std::optional<std::filesystem::path> written;
    if (box.size() > 0) {
        // The last ticks are worth a second place.
        try {
            write_black_box(left.csv, box);
            written = left.csv;
        } catch (const std::runtime_error& error) {
            spdlog::warn("{}", error.what());
            written = std::filesystem::temp_directory_path() / left.csv.filename();
            write_black_box(*written, box);
        }
    }
    unlink(left.file.c_str());
    return written;
}

void save_left_black_box(const std::string& session) {
    try {
        if (std::optional<LeftBlackBox> left = read_left_black_box(session, kGuardSavesSeconds)) {
            if (const auto file = save_black_box(std::move(*left))) {
                spdlog::warn("the last run of session {} was killed; its last ticks are in {}", session,
                             file->string());
            }
        }
    } catch (const std::runtime_error& error) {
        spdlog::warn("{}", error.what());
    }
}

int black_box_command(const BlackBoxOptions& options) {
    FileUses files;
    files.also_reads("--session " + options.session, BlackBoxFile::path_of(options.session));
    files.writes("--out ", options.out);
    files.require_distinct();
    std::optional<LeftBlackBox> left = read_left_black_box(options.session, kGuardSavesSeconds);
    if (!left) {
        throw Refusal("no run of session " + options.session + " has left a black box; an orderly end removes it");
    }
    if (options.out) {
        left->csv = *options.out;
    }
    const auto file = save_black_box(std::move(*left));
    std::printf("%s\n", file ? ("the last ticks are in " + file->string()).c_str() : "the run had no tick");
    return kExitDone;
}

}  // namespace haptic::rt
