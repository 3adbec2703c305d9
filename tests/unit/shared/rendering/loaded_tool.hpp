// A tool contact that prepares the frames it is given, for tests.
#pragma once

#include <array>
#include <cstddef>

#include "haptic/frames.hpp"
#include "rendering/tool_contact.hpp"

namespace haptic::test {

class LoadedTool : public ToolContact {
  public:
    void load(const ContactFrame& frame) {
        // The last frame stays as it was: the rows of both are compared.
        current_ = 1 - current_;
        frames_[current_].frame = frame;
        frames_[current_].prepare();
        ToolContact::load(frames_[current_]);
    }

    /// The loaded copy; for changes that leave its rows and their compliance as they are.
    [[nodiscard]] ContactFrame& frame() { return frames_[current_].frame; }

  private:
    std::array<PreparedFrame, 2> frames_;
    std::size_t current_ = 0;
};

}  // namespace haptic::test
