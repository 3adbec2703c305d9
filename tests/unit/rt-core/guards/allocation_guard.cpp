#include "allocation_guard.hpp"

#include <cerrno>
#include <cstddef>

// The C library's allocator under its internal names, which are not replaced.
// NOLINTBEGIN(*-reserved-identifier,*-identifier-naming)
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* memory);
}
// NOLINTEND(*-reserved-identifier,*-identifier-naming)

namespace {

// In the executable's own thread-local storage, so that accessing them allocates nothing.
thread_local bool guarded = false;
thread_local std::size_t counted = 0;

void note() noexcept {
    counted += guarded ? 1u : 0u;
}

}  // namespace

extern "C" {

void* malloc(std::size_t size) {
    note();
    return __libc_malloc(size);
}

void* calloc(std::size_t count, std::size_t size) {
    note();
    return __libc_calloc(count, size);
}

void* realloc(void* memory, std::size_t size) {
    note();
    return __libc_realloc(memory, size);
}

void* memalign(std::size_t alignment, std::size_t size) {
    note();
    return __libc_memalign(alignment, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) {
    note();
    return __libc_memalign(alignment, size);
}

int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
    note();
    *memory = __libc_memalign(alignment, size);
    return *memory == nullptr ? ENOMEM : 0;
}

void free(void* memory) {
    note();
    __libc_free(memory);
}

}  // extern "C"

namespace haptic::test {

AllocationGuard::AllocationGuard() noexcept {
    counted = 0;
    guarded = true;
}

AllocationGuard::~AllocationGuard() {
    guarded = false;
}

std::size_t AllocationGuard::calls() const noexcept {
    return counted;
}

}  // namespace haptic::test
