// Keys of a body: tables [model] and [[objects]] of a scene, with [[model.regions]] and [[model.copies]].
#pragma once

#include "haptic/setting_documents.hpp"

namespace haptic::sim {

/// Adds the descriptions of [model], its regions and copies, and [[objects]].
void add_model_reference(SettingReference& reference);

}  // namespace haptic::sim
