// What the compiler must refuse: a function under the real-time contract that allocates two calls down. Only compiled
// by the test RealtimeContract.CompilerRefusesAnAllocationTwoCallsDown, and only to fail.
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
