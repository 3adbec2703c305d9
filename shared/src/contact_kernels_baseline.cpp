// Kernels for the registers that every machine has.
#include "contact_kernels.hpp"
#include "contact_rows.hpp"

namespace haptic {

extern const ContactKernels kBaselineContactKernels = ContactRows<16>::kKernels;

}  // namespace haptic
