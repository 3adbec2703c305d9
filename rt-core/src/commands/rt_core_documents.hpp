// Documents of rt-core: the texts of its man pages that its options and settings do not say.
#pragma once

#include "documents/program_documents.hpp"

namespace haptic::rt {

[[nodiscard]] ProgramDocuments rt_core_documents();

}  // namespace haptic::rt
