// Documents of host-sim: the texts of its man pages that its options and settings do not say.
#pragma once

#include "documents/program_documents.hpp"

namespace haptic::sim {

[[nodiscard]] ProgramDocuments host_sim_documents();

}  // namespace haptic::sim
