// Prepared frame: a contact frame as the renderer takes it, checked, with the rows of its contact problem
// (contact_problem.hpp) laid out and their compliance as a matrix. Preparing it depends on nothing that a tick measures
// and takes longer than rendering it, so that another thread may do it. Proxies and planes are laid out once more as
// one array per coordinate, so that a tick reads a quarter of the memory and computes several proxies at a time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "haptic/contact_problem.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"
#include "rendering/independent_proxies.hpp"
#include "rendering/proxy_arrays.hpp"

namespace haptic {

/// A row of the contact problem.
struct ContactRow {
    Vec3 direction{0.0, 0.0, 0.0};  // unit
    std::uint16_t proxy = 0;
    bool tangential = false;
};

/// Rows of one proxy: normals, then two tangents if it has friction.
struct ProxyRows {
    std::uint16_t first = 0;
    std::uint16_t normals = 0;
    bool friction = false;
    [[nodiscard]] std::size_t end() const HAPTIC_RT { return std::size_t{first} + normals + (friction ? 2U : 0U); }
    friend bool operator==(const ProxyRows&, const ProxyRows&) = default;
};

/// N/m, of the springs that make the torque.
[[nodiscard]] double torque_stiffness_of(const ContactFrame& frame) HAPTIC_RT;

/// The end of a tick, from which the first evaluation of the next frame starts.
struct FrameStart {
    std::uint64_t layout = 0;  // PreparedFrame::layout() of the frame that it rendered
    RowSet pushing;            // normal rows that push; none if they mean something else in the next frame
    Pose grip;
    std::int64_t time_ns = 0;
};

/// The springs of a frame at the grip and the time of a FrameStart, evaluated ahead of the tick that takes the frame.
struct FramePreview {
    FrameStart start;
    Wrench wrench;   // per stiffness
    RowSet pushing;  // normal rows that push there: those of the factor
};

class PreparedFrame {
  public:
    /// Allocates all memory.
    PreparedFrame() : rows_(kMaxContactRows) {}

    /// To be filled in; prepare() then makes everything below agree with it.
    ContactFrame frame{};

    /// Checks the frame, and prepares it if it has no defect. Bounded by the largest frame.
    void prepare() HAPTIC_RT;
    /// Of the frame that was prepared; if there is one, the rest must not be used.
    [[nodiscard]] FrameDefect defect() const HAPTIC_RT { return defect_; }

    /// At most kMaxProxies.
    [[nodiscard]] std::size_t proxies() const HAPTIC_RT { return proxy_count_; }
    /// Of the proxies, as the frame sends them.
    [[nodiscard]] const ProxyVectors& rest_offset() const HAPTIC_RT { return rest_offset_; }
    [[nodiscard]] const ProxyVectors& rest_velocity() const HAPTIC_RT { return rest_velocity_; }
    /// A rest offset moves.
    [[nodiscard]] bool rest_moves() const HAPTIC_RT { return rest_moves_; }
    /// Plane k of each proxy, for k < plane_count(); a proxy that has fewer has ProxyPlanes::kNone in its place.
    [[nodiscard]] const ProxyPlanes& planes(std::size_t k) const HAPTIC_RT { return planes_[k]; }
    /// The largest number of planes of a proxy.
    [[nodiscard]] std::size_t plane_count() const HAPTIC_RT { return plane_count_; }
    /// m: friction acts at this distance from the centre of a proxy; 0 without friction, and for a limp tool.
    [[nodiscard]] double friction_arm(std::size_t proxy) const HAPTIC_RT { return friction_arm_[proxy]; }
    /// m, the largest of them.
    [[nodiscard]] double max_friction_arm() const HAPTIC_RT { return max_friction_arm_; }
    /// m^2, mean square of the rest offsets: factor from a torque stiffness (N/m) to the largest rotational stiffness
    /// (N*m/rad) about an axis that a tool coupled with it can have, however stiff.
    [[nodiscard]] double squared_moment_arm() const HAPTIC_RT { return squared_moment_arm_; }
    /// A proxy has friction.
    [[nodiscard]] bool has_friction() const HAPTIC_RT { return has_friction_; }
    [[nodiscard]] const ProxyRows& rows_of(std::size_t proxy) const HAPTIC_RT { return proxy_rows_[proxy]; }
    [[nodiscard]] std::size_t row_count() const HAPTIC_RT { return row_count_; }
    [[nodiscard]] const ContactRow& row(std::size_t row) const HAPTIC_RT { return rows_[row]; }
    /// The same number for frames whose rows mean the same, and different ones for nearly all others.
    [[nodiscard]] std::uint64_t layout() const HAPTIC_RT { return layout_; }
    /// Its rows mean what those of the other frame do.
    [[nodiscard]] bool has_rows_of(const PreparedFrame& other) const HAPTIC_RT;

    /// No proxy yields to a force on another: a limp tool with one stiffness. There is no compliance() then, and each
    /// proxy has a small problem of its own: independent_proxies(), and copy_compliance() with friction.
    [[nodiscard]] bool is_independent() const HAPTIC_RT { return independent_; }
    [[nodiscard]] const IndependentProxies& independent_proxies() const HAPTIC_RT { return independent_proxies_; }
    /// k W of all rows.
    [[nodiscard]] const ComplianceMatrix& compliance() const HAPTIC_RT { return compliance_; }
    /// k W of the rows from `begin` to `end` of a limp tool, as the rows of a matrix.
    void copy_compliance(std::size_t begin, std::size_t end, ComplianceMatrix& compliance) const HAPTIC_RT;
    /// The factor of these rows of compliance(), for a first solution that starts from them.
    [[nodiscard]] RowFactor& factor_of(const RowSet& pushing) HAPTIC_RT;

    /// Evaluated by ToolContact::preview_ahead(), which has left the factor at its end.
    void set_preview(const FramePreview& preview) HAPTIC_RT;
    /// The preview from this start, or nullptr: evaluated ahead or not, it has the same bits.
    [[nodiscard]] const FramePreview* preview_from(const FrameStart& start) const HAPTIC_RT;
    /// The factor at its end.
    [[nodiscard]] RowFactor& previewed_factor() HAPTIC_RT { return factor_; }

  private:
    void lay_out_rows() HAPTIC_RT;
    void lay_out_proxies() HAPTIC_RT;
    void load_compliance() HAPTIC_RT;

    FrameDefect defect_ = FrameDefect::None;
    std::array<ProxyRows, kMaxProxies> proxy_rows_{};
    std::size_t proxy_count_ = 0;
    std::vector<ContactRow> rows_;
    std::size_t row_count_ = 0;
    ProxyVectors rest_offset_;
    ProxyVectors rest_velocity_;
    bool rest_moves_ = false;
    std::array<ProxyPlanes, kMaxPlanes> planes_;
    std::size_t plane_count_ = 0;
    double squared_moment_arm_ = 0.0;
    ProxyValues friction_arm_{};
    double max_friction_arm_ = 0.0;
    bool has_friction_ = false;
    bool independent_ = true;
    IndependentProxies independent_proxies_;
    ComplianceMatrix compliance_;
    std::uint64_t layout_ = 0;
    RowFactor factor_;
    FramePreview preview_;
    bool has_preview_ = false;
};

}  // namespace haptic
