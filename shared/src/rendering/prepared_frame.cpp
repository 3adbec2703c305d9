#include "rendering/prepared_frame.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

namespace haptic {
namespace {

// k W_rr of a row that only the springs to the hand hold back.
constexpr double kMinRelativeCompliance = 1.0;

}  // namespace

double torque_stiffness_of(const ContactFrame& frame) HAPTIC_RT {
    return frame.torque_stiffness > 0.0 ? frame.torque_stiffness : frame.stiffness;
}

void PreparedFrame::prepare() HAPTIC_RT {
    defect_ = find_defect(frame);
    has_preview_ = false;
    if (defect_ != FrameDefect::None) {
        return;
    }
    lay_out_rows();
    lay_out_proxies();
    independent_ = frame.compliance_rows == 0 && torque_stiffness_of(frame) == frame.stiffness;
    if (frame.compliance_rows > 0) {
        load_compliance();
    } else if (independent_) {
        independent_proxies_.load(planes_, plane_count_, proxy_count_, static_cast<double>(proxy_count_));
    } else {
        copy_compliance(0, row_count_, compliance_);
    }
}

void PreparedFrame::lay_out_rows() HAPTIC_RT {
    const bool rough = frame.static_friction > 0.0;
    proxy_count_ = frame.proxy_count;
    row_count_ = 0;
    layout_ = 0xcbf29ce484222325U;
    has_friction_ = false;
    for (std::size_t i = 0; i < proxy_count_; ++i) {
        const ProxyContact& sent = frame.proxies[i];
        ProxyRows& proxy = proxy_rows_[i];
        proxy.first = static_cast<std::uint16_t>(row_count_);
        proxy.normals = static_cast<std::uint16_t>(sent.plane_count);
        // Tangents are those of the compliance; a limp tool has them where there is friction.
        proxy.friction =
            frame.compliance_rows > 0 ? (sent.in_contact & HAPTIC_PROXY_TANGENTS) != 0 : rough && proxy.normals > 0;
        has_friction_ = has_friction_ || proxy.friction;
        // FNV-1a of the numbers of rows.
        layout_ = (layout_ ^ (2U * proxy.normals + (proxy.friction ? 1U : 0U))) * 0x100000001b3U;
        for (std::size_t k = 0; k < proxy.normals; ++k) {
            rows_[row_count_++] = {to_vec3(sent.planes[k].normal), static_cast<std::uint16_t>(i), false};
        }
        if (proxy.friction) {
            for (const Vec3& tangent : contact_tangents(to_vec3(sent.planes[0].normal))) {
                rows_[row_count_++] = {tangent, static_cast<std::uint16_t>(i), true};
            }
        }
    }
}

void PreparedFrame::lay_out_proxies() HAPTIC_RT {
    rest_moves_ = false;
    plane_count_ = 0;
    max_friction_arm_ = 0.0;
    double squares = 0.0;
    for (std::size_t i = 0; i < proxy_count_; ++i) {
        const ProxyContact& sent = frame.proxies[i];
        const Vec3 offset = to_vec3(sent.rest_offset);
        const Vec3 velocity = to_vec3(sent.rest_velocity);
        rest_offset_.set(i, offset);
        rest_velocity_.set(i, velocity);
        rest_moves_ = rest_moves_ || velocity != Vec3(0.0);
        squares += glm::dot(offset, offset);
        // Spheres of a limp tool turn freely.
        friction_arm_[i] = proxy_rows_[i].friction && frame.compliance_rows > 0 ? sent.radius : 0.0;
        max_friction_arm_ = std::max(max_friction_arm_, friction_arm_[i]);
        plane_count_ = std::max<std::size_t>(plane_count_, sent.plane_count);
        for (std::size_t k = 0; k < kMaxPlanes; ++k) {
            const bool exists = k < sent.plane_count;
            const ContactPlane& plane = sent.planes[k];
            planes_[k].normal.set(i, exists ? to_vec3(plane.normal) : Vec3(0.0));
            planes_[k].offset[i] = exists ? plane.offset : ProxyPlanes::kNone;
            planes_[k].velocity[i] = exists ? plane.velocity : 0.0;
        }
    }
    squared_moment_arm_ = proxy_count_ > 0 ? squares / static_cast<double>(proxy_count_) : 0.0;
}

bool PreparedFrame::has_rows_of(const PreparedFrame& other) const HAPTIC_RT {
    return proxy_count_ == other.proxy_count_ && row_count_ == other.row_count_ &&
           std::equal(proxy_rows_.begin(), proxy_rows_.begin() + static_cast<std::ptrdiff_t>(proxy_count_),
                      other.proxy_rows_.begin());
}

RowFactor& PreparedFrame::factor_of(const RowSet& pushing) HAPTIC_RT {
    factor_.make(compliance_, pushing);
    has_preview_ = false;
    return factor_;
}

void PreparedFrame::set_preview(const FramePreview& preview) HAPTIC_RT {
    preview_ = preview;
    has_preview_ = true;
}

const FramePreview* PreparedFrame::preview_from(const FrameStart& start) const HAPTIC_RT {
    const FrameStart& made = preview_.start;
    const bool same = has_preview_ && made.time_ns == start.time_ns && made.grip.position == start.grip.position &&
                      made.grip.orientation == start.grip.orientation && made.pushing == start.pushing;
    return same ? &preview_ : nullptr;
}

/// Elastic tool: the compliance that the frame brings.
void PreparedFrame::load_compliance() HAPTIC_RT {
    compliance_.resize(row_count_);
    for (std::size_t r = 0; r < row_count_; ++r) {
        compliance_.set_lower_row(r, &frame.compliance[compliance_index(r, 0)]);
        // The springs that translate the whole tool with the grip are in series with every contact, so that k W_rr is
        // at least 1, and the limits of stiffness rely on it: a simulator that sends W in m/N would bypass them. This
        // bounds each contact by k, not their sum. A larger diagonal leaves W positive. A tangential row of exactly 0
        // has no friction: the solver excludes it.
        const double diagonal = compliance_(r, r);
        if (!rows_[r].tangential || diagonal != 0.0) {
            compliance_.set(r, r, std::max(diagonal, kMinRelativeCompliance));
        }
    }
    compliance_.mirror();
}

/// Limp tool: k W_rs = k d_r . C_ij d_s.
void PreparedFrame::copy_compliance(std::size_t begin, std::size_t end, ComplianceMatrix& compliance) const HAPTIC_RT {
    compliance.resize(end - begin);
    const double of_rotation = frame.stiffness / torque_stiffness_of(frame);
    const double shared = 1.0 - of_rotation;
    const double own = static_cast<double>(proxy_count_) * of_rotation + shared;
    for (std::size_t r = begin; r < end; ++r) {
        compliance.set(r - begin, r - begin, own);
        for (std::size_t s = begin; s < r; ++s) {
            const double between = rows_[r].proxy == rows_[s].proxy ? own : shared;
            compliance.set(r - begin, s - begin,
                           (1.0 - kSurfaceShare) * between * glm::dot(rows_[r].direction, rows_[s].direction));
        }
    }
}

}  // namespace haptic
