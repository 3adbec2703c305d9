// Allocation guard: counts the calling thread's allocations and frees during its lifetime. Linking allocation_guard.cpp
// into a test replaces the C library's allocator, and with it operator new.
#pragma once

#include <cstddef>

namespace haptic::test {

class AllocationGuard {
  public:
    AllocationGuard() noexcept;
    AllocationGuard(const AllocationGuard&) = delete;
    AllocationGuard& operator=(const AllocationGuard&) = delete;
    ~AllocationGuard();

    /// Calls of malloc, calloc, realloc, free, aligned_alloc, memalign and posix_memalign by this thread so far.
    [[nodiscard]] std::size_t calls() const noexcept;
};

}  // namespace haptic::test
