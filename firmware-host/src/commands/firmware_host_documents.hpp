// Documents of firmware-host: the texts of its man page that its options do not say.
#pragma once

#include "documents/program_documents.hpp"

namespace haptic::device {

[[nodiscard]] ProgramDocuments firmware_host_documents();

}  // namespace haptic::device
