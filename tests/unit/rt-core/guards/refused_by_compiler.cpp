// Code that the compiler must reject: a function under the real-time contract that allocates two calls down. Compiled
// only by the test RealtimeContract.CompilerRefusesAnAllocationTwoCallsDown, which expects an error.
#include <vector>

#include "haptic/realtime.hpp"

namespace {

void keep(std::vector<int>& values) {
    values.push_back(1);
}

void pass_on(std::vector<int>& values) {
    keep(values);
}

}  // namespace

void tick(std::vector<int>& values) HAPTIC_RT;
void tick(std::vector<int>& values) HAPTIC_RT {
    pass_on(values);
}
