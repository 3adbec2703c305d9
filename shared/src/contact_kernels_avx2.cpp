// Kernels for AVX2.
#include "contact_kernels.hpp"
#include "contact_rows.hpp"

namespace haptic {

extern const ContactKernels kAvx2ContactKernels = ContactRows<32>::kKernels;

}  // namespace haptic
