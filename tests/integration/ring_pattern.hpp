// Test pattern for rings: frames whose words are determined by sequence and session, and processes that exchange them.
#pragma once

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <functional>
#include <new>
#include <stdexcept>
#include <string>

#include "haptic/ring.hpp"

namespace haptic::test {

/// SplitMix64 (Steele et al. 2014), so that a word of another frame or at another index is detected.
inline std::uint64_t mix(std::uint64_t x) noexcept {
    x += 0x9E3779B97F4A7C15;
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9;
    x = (x ^ (x >> 27)) * 0x94D049BB133111EB;
    return x ^ (x >> 31);
}

/// Words 0 and 1 of a slot are its sequence and session; proxy_count determines the length of a contact frame.
template <class Slot>
inline constexpr std::size_t kFirstPatternWord = 2;
template <>
inline constexpr std::size_t kFirstPatternWord<ContactFrame> = offsetof(ContactFrame, proxies) / sizeof(std::uint64_t);

inline void set_length(DeviceState& /*slot*/, std::uint64_t /*seed*/) noexcept {}
inline void set_length(ContactFrame& slot, std::uint64_t seed) noexcept {
    slot.proxy_count = seed % 4 == 0 ? static_cast<std::uint32_t>(mix(seed) % (kMaxProxies + 1)) : kMaxProxies;
}

/// Fills the used part for the sequence that the slot will get: one mixed seed, then a counter per word.
template <class Slot>
void fill(Slot& slot, std::uint64_t sequence, std::uint64_t session) noexcept {
    set_length(slot, sequence);
    const std::uint64_t seed = mix(sequence ^ mix(session));
    auto* const bytes = reinterpret_cast<unsigned char*>(&slot);
    const std::size_t words = detail::used_bytes(slot) / sizeof(std::uint64_t);
    for (std::size_t i = kFirstPatternWord<Slot>; i < words; ++i) {
        const std::uint64_t word = seed + i * 0xD6E8FEB86659FD93;
        std::memcpy(bytes + i * sizeof word, &word, sizeof word);
    }
}

/// Whether every used word belongs to this frame.
template <class Slot>
bool is_whole(const Slot& slot) noexcept {
    Slot expected_length{};
    set_length(expected_length, slot.sequence);
    const std::size_t words = detail::used_bytes(slot) / sizeof(std::uint64_t);
    bool whole = words == detail::used_bytes(expected_length) / sizeof(std::uint64_t);
    const std::uint64_t seed = mix(slot.sequence ^ mix(slot.session));
    const auto* const bytes = reinterpret_cast<const unsigned char*>(&slot);
    for (std::size_t i = kFirstPatternWord<Slot>; i < words; ++i) {
        std::uint64_t word = 0;
        std::memcpy(&word, bytes + i * sizeof word, sizeof word);
        whole = whole && word == seed + i * 0xD6E8FEB86659FD93;
    }
    return whole;
}

/// A writer of such frames. It continues after its predecessor, which may have died at any frame.
template <class Slot>
class PatternWriter : public RingWriter<Slot> {
  public:
    using RingWriter<Slot>::RingWriter;
    std::uint64_t publish_pattern(Slot& slot, std::int64_t now_ns) {
        fill(slot, this->next_sequence(), this->session_id());
        return this->publish(slot, now_ns);
    }
};

/// A value shared between this process and its children.
template <class Value>
class Shared {
  public:
    Shared() {
        void* const memory = mmap(nullptr, sizeof(Value), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
        if (memory == MAP_FAILED) {
            throw std::runtime_error("no memory to share");
        }
        value_ = new (memory) Value{};
    }
    Shared(const Shared&) = delete;
    Shared& operator=(const Shared&) = delete;
    ~Shared() { munmap(value_, sizeof(Value)); }
    Value* operator->() const noexcept { return value_; }
    Value& operator*() const noexcept { return *value_; }

  private:
    Value* value_;
};

/// Runs a function in a child process, which then exits with its result; 99 if it throws.
inline pid_t start_process(const std::function<int()>& function) {
    std::fflush(nullptr);  // otherwise the child would print buffered output again
    const pid_t child = fork();
    if (child < 0) {
        throw std::runtime_error("cannot fork");
    }
    if (child == 0) {
        int status = 99;
        try {
            status = function();
        } catch (const std::exception& error) {
            static_cast<void>(std::fprintf(stderr, "child: %s\n", error.what()));
        }
        _exit(status);
    }
    return child;
}

/// Exit status of a child, as returned by waitpid.
inline int wait_for(pid_t child) {
    int status = 0;
    while (waitpid(child, &status, 0) != child) {
    }
    return status;
}

}  // namespace haptic::test
