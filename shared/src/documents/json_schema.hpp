// JSON schema: the keys of a configuration file in the form by which editors complete and check TOML.
#pragma once

#include <string>

#include "haptic/setting_documents.hpp"

namespace haptic {

/// A JSON schema (draft 7) of a configuration file: types, ranges, choices, units and meanings, former names marked as
/// deprecated, and no other key than these. It does not know conditions between keys; the program checks those. Throws
/// std::logic_error for a type that it cannot express.
[[nodiscard]] std::string json_schema(const std::string& title, const SettingReference& reference);

}  // namespace haptic
