#include "contact_kernels.hpp"

namespace haptic {

const ContactKernels& widest_contact_kernels() noexcept {
#if defined(__x86_64__)
    static const bool has_avx2 = __builtin_cpu_supports("avx2") != 0;
    if (has_avx2) {
        return kAvx2ContactKernels;
    }
#endif
    return kBaselineContactKernels;
}

}  // namespace haptic
