#include "process/supervision.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <new>
#include <system_error>

namespace haptic::rt {
namespace {

constexpr std::array<const char*, kSupervisors> kNames = {"watchdog", "stop line", "guard"};
// Looks within the limit: a look that comes later than the next one was due counts as one.
constexpr std::int64_t kLooks = 4;

[[noreturn]] void fail(const char* what) {
    throw std::system_error(errno, std::system_category(), what);
}

}  // namespace

std::string supervisor_names(std::uint32_t bits) {
    std::string names;
    for (std::size_t i = 0; i < kNames.size(); ++i) {
        if ((bits >> i & 1U) != 0) {
            names += (names.empty() ? "" : ", ") + std::string(kNames[i]);
        }
    }
    return names;
}

SharedSupervision::SharedSupervision()
    : descriptor_(memfd_create("haptic-supervision", MFD_CLOEXEC | MFD_ALLOW_SEALING)) {
    if (descriptor_ < 0 || ftruncate(descriptor_, sizeof(SupervisionPage)) != 0 ||
        fcntl(descriptor_, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0) {
        fail("memory shared with the guard cannot be created");
    }
    map();
    new (page_) SupervisionPage;
}

SharedSupervision::SharedSupervision(int descriptor) : descriptor_(descriptor) {
    map();
}

SharedSupervision::~SharedSupervision() {
    munmap(page_, sizeof(SupervisionPage));
    close(descriptor_);
}

void SharedSupervision::map() {
    void* const memory = mmap(nullptr, sizeof(SupervisionPage), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, 0);
    if (memory == MAP_FAILED) {
        fail("memory shared with the guard cannot be mapped");
    }
    page_ = static_cast<SupervisionPage*>(memory);
}

SupervisorCheck::SupervisorCheck(const Supervision& supervision, std::optional<Supervisor> self)
    : supervision_(supervision), self_(self) {}

void SupervisorCheck::check(std::int64_t now_ns) noexcept {
    if (supervision_.page == nullptr) {
        return;
    }
    // Time that this thread has slept longer than it wanted is no silence of the others.
    const std::int64_t elapsed_ns = last_ns_ == 0 ? 0 : std::min(now_ns - last_ns_, supervision_.limit_ns / kLooks);
    last_ns_ = now_ns;
    for (std::size_t i = 0; i < kSupervisors; ++i) {
        const std::uint64_t beats = supervision_.page->beats[i].load(std::memory_order_relaxed);
        const bool silent = beats != 0 && beats == beats_[i] && (!self_ || i != static_cast<std::size_t>(*self_));
        silent_ns_[i] = silent ? silent_ns_[i] + elapsed_ns : 0;
        beats_[i] = beats;
        if (silent_ns_[i] >= supervision_.limit_ns) {
            supervision_.page->lost.fetch_or(1U << i);
        }
    }
}

}  // namespace haptic::rt
