// Calls that a tick must never make, for the test that the symbol check detects them.
#include <cstdio>
#include <mutex>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

namespace haptic::test {

std::mutex forbidden_mutex;

namespace {

__attribute__((noinline)) void deep(std::vector<int>& values, int value) {
    values.push_back(value);
}

}  // namespace

int forbidden_allocation(int value) {
    std::vector<int> values;
    deep(values, value);
    return values.back();
}

int forbidden_lock(int value) {
    const std::lock_guard lock(forbidden_mutex);
    return value + 1;
}

int forbidden_throw(int value) {
    if (value < 0) {
        throw std::runtime_error("negative");
    }
    return value;
}

int forbidden_print(int value) {
    return std::printf("%d\n", value);
}

int allowed_arithmetic(int value) {
    return 3 * value + 1;
}

}  // namespace haptic::test
