#include "app/record_file.hpp"

#include <chrono>

#include "app/background.hpp"

namespace haptic::sim {
namespace {

constexpr std::chrono::milliseconds kWritePeriod{250};
// Lines of a period at 1000 steps per second, so that append() rarely allocates.
constexpr std::size_t kReservedBytes = std::size_t{256} * 1024;

}  // namespace

RecordFile::RecordFile(const std::filesystem::path& file) : file_(file) {
    pending_.reserve(kReservedBytes);
    writer_ = in_background([this] { write_until_closed(); });
}

RecordFile::~RecordFile() {
    end_writer();
}

void RecordFile::append(std::string_view lines) {
    const std::lock_guard lock(mutex_);
    pending_ += lines;
}

void RecordFile::write_until_closed() {
    std::string lines;
    lines.reserve(kReservedBytes);
    for (bool closing = false; !closing;) {
        {
            std::unique_lock lock(mutex_);
            closing = wake_.wait_for(lock, kWritePeriod, [this] { return closing_; });
            lines.swap(pending_);
        }
        (void)file_.append(lines);  // close() reports a failure
        lines.clear();
    }
}

void RecordFile::end_writer() {
    {
        const std::lock_guard lock(mutex_);
        closing_ = true;
    }
    wake_.notify_one();
    if (writer_.valid()) {
        writer_.get();
    }
}

void RecordFile::close() {
    end_writer();
    file_.close();
}

}  // namespace haptic::sim
