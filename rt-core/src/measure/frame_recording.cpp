#include "measure/frame_recording.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <system_error>
#include <type_traits>

namespace haptic::rt {
namespace {

// Indices of the leading columns, before those of visit_cells().
constexpr std::size_t kTime = 0;
constexpr std::size_t kDefect = 1;
constexpr std::size_t kParticle = 2;
constexpr std::size_t kFirstCell = 3;

template <class Array, class Visit>
void visit_each(Array& values, Visit&& visit) {
    for (auto& value : values) {
        visit(value);
    }
}

/// Visits every number of a frame and of one of its proxies in the order of the columns; shared by writer and reader.
template <class Frame, class Proxy, class Visit>
void visit_cells(Frame& frame, Proxy& proxy, Visit&& visit) {
    visit(frame.sequence);
    visit(frame.session);
    visit(frame.state_sequence);
    visit(frame.state_time_ns);
    visit(frame.plane_time_ns);
    visit(frame.publish_time_ns);
    visit(frame.step_ns);
    visit(frame.stiffness);
    visit(frame.torque_stiffness);
    visit(frame.static_friction);
    visit(frame.dynamic_friction);
    visit(frame.body_work);
    visit(frame.proxy_count);
    visit(frame.flags);
    visit(frame.compliance_rows);
    visit(frame.reserved);
    visit_each(proxy.rest_offset, visit);
    visit_each(proxy.rest_velocity, visit);
    visit(proxy.radius);
    visit_each(proxy.position, visit);
    visit_each(proxy.surface_velocity, visit);
    visit(proxy.in_contact);
    visit(proxy.plane_count);
    for (auto& plane : proxy.planes) {
        visit_each(plane.normal, visit);
        visit(plane.offset);
        visit(plane.velocity);
    }
}

CsvCell cell_of(double value) {
    return std::isfinite(value) ? value : 0.0;
}
CsvCell cell_of(std::int64_t value) {
    return value;
}
CsvCell cell_of(std::uint64_t value) {
    return value;
}
CsvCell cell_of(std::uint32_t value) {
    return std::uint64_t{value};
}

std::size_t particles_of(const ContactFrame& frame) {
    return std::min<std::size_t>(frame.proxy_count, kMaxProxies);
}
/// Rows of the compliance that are recorded. A frame that announces more than there can be is defective.
std::size_t compliance_rows_of(const ContactFrame& frame) {
    return std::min<std::size_t>(frame.compliance_rows, kMaxComplianceRows);
}

}  // namespace

std::filesystem::path frames_file(const std::filesystem::path& recording) {
    return std::filesystem::path(recording).replace_extension("frames.csv");
}

const std::vector<std::string>& frame_columns() {
    static const std::vector<std::string> columns = [] {
        std::vector<std::string> names = {"now_ns",
                                          "defect",
                                          "particle",
                                          "sequence",
                                          "session",
                                          "state_sequence",
                                          "state_time_ns",
                                          "plane_time_ns",
                                          "publish_time_ns",
                                          "step_ns",
                                          "stiffness_n_m",
                                          "torque_stiffness_n_m",
                                          "static_friction",
                                          "dynamic_friction",
                                          "body_work_j",
                                          "proxy_count",
                                          "frame_flags",
                                          "compliance_rows",
                                          "reserved",
                                          "rest_x_m",
                                          "rest_y_m",
                                          "rest_z_m",
                                          "rest_vx_m_s",
                                          "rest_vy_m_s",
                                          "rest_vz_m_s",
                                          "radius_m",
                                          "x_m",
                                          "y_m",
                                          "z_m",
                                          "surface_vx_m_s",
                                          "surface_vy_m_s",
                                          "surface_vz_m_s",
                                          "in_contact",
                                          "plane_count"};
        for (std::size_t k = 0; k < kMaxPlanes; ++k) {
            for (const char* quantity : {"_nx", "_ny", "_nz", "_offset_m", "_velocity_m_s"}) {
                names.push_back("plane" + std::to_string(k) + quantity);
            }
        }
        return names;
    }();
    return columns;
}

std::filesystem::path compliance_file(const std::filesystem::path& frames) {
    // F.frames.csv without both extensions.
    return std::filesystem::path(frames).replace_extension().replace_extension("compliance.csv");
}

const std::vector<std::string>& compliance_columns() {
    static const std::vector<std::string> columns = [] {
        std::vector<std::string> names = {"now_ns", "row"};
        for (std::size_t s = 0; s < kMaxComplianceRows; ++s) {
            names.push_back("column" + std::to_string(s));
        }
        return names;
    }();
    return columns;
}

FrameWriter::FrameWriter(const std::filesystem::path& file)
    : frames_(file, frame_columns()), compliance_file_(compliance_file(file)) {
    // Compliances of an earlier recording of this name do not belong to this one.
    std::error_code error;
    std::filesystem::remove(compliance_file_, error);
    if (error) {
        throw CsvError(compliance_file_.string() + ": cannot be removed: " + error.message());
    }
}

bool FrameWriter::flush() noexcept {
    // A frame is read together with its compliance, which therefore comes first.
    return !no_compliance_ && (!compliance_ || compliance_->flush()) && frames_.flush();
}

void FrameWriter::close() {
    if (no_compliance_) {
        std::rethrow_exception(no_compliance_);
    }
    if (compliance_) {
        compliance_->close();
    }
    frames_.close();
}

void FrameWriter::write_compliance(const RecordedFrame& recorded) {
    const std::size_t rows = compliance_rows_of(recorded.frame);
    if (rows == 0 || no_compliance_) {
        return;
    }
    if (!compliance_) {
        // The run goes on without the file; close() reports it.
        try {
            compliance_.emplace(compliance_file_, compliance_columns());
        } catch (const std::runtime_error&) {
            no_compliance_ = std::current_exception();
            return;
        }
    }
    auto& file = *compliance_;
    for (std::size_t r = 0; r < rows; ++r) {
        // A float is written as the double of the same value.
        row_.assign({recorded.now_ns, static_cast<std::int64_t>(r)});
        row_.resize(compliance_columns().size(), 0.0);
        for (std::size_t s = 0; s <= r; ++s) {
            row_[2 + s] = cell_of(double{recorded.frame.compliance[compliance_index(r, s)]});
        }
        file.row(row_);
    }
}

void FrameWriter::write(const RecordedFrame& recorded) {
    const ContactFrame& frame = recorded.frame;
    const std::size_t particles = particles_of(frame);
    for (std::size_t i = 0; i < std::max<std::size_t>(particles, 1); ++i) {
        ProxyContact proxy = particles > 0 ? frame.proxies[i] : ProxyContact{};
        for (std::size_t k = proxy.plane_count; k < kMaxPlanes; ++k) {
            proxy.planes[k] = ContactPlane{};  // stale values beyond plane_count
        }
        const std::int64_t particle = particles > 0 ? static_cast<std::int64_t>(i) : -1;
        row_ = {recorded.now_ns, static_cast<std::int64_t>(recorded.defect), particle};
        visit_cells(frame, proxy, [this](const auto& value) { row_.push_back(cell_of(value)); });
        frames_.row(row_);
    }
    write_compliance(recorded);
}

FrameReader::FrameReader(const std::filesystem::path& file) : reader_(file), compliance_file_(compliance_file(file)) {
    for (const std::string& column : frame_columns()) {
        order_.push_back(reader_.index(column));
    }
    more_ = reader_.next();
}

void FrameReader::read_row(RecordedFrame& recorded, std::int64_t particle) {
    std::size_t column = kFirstCell;
    // Reads the next cell into a number of any type, with a range check.
    const auto read = [this, &column](auto& value) {
        const std::size_t cell = order_[column++];
        using Value = std::remove_reference_t<decltype(value)>;
        if constexpr (std::is_same_v<Value, double>) {
            value = reader_.number(cell);
        } else if constexpr (std::is_signed_v<Value>) {
            value = reader_.integer(cell);
        } else {
            const std::uint64_t number = reader_.natural(cell);
            if (number > std::numeric_limits<Value>::max()) {
                reader_.fail("column " + frame_columns()[column - 1] + ": too large");
            }
            value = static_cast<Value>(number);
        }
    };
    ProxyContact none{};
    ProxyContact& proxy = particle < 0 ? none : recorded.frame.proxies[particle];
    visit_cells(recorded.frame, proxy, read);
}

void FrameReader::read_compliance(RecordedFrame& recorded) {
    const std::size_t rows = compliance_rows_of(recorded.frame);
    if (rows == 0) {
        return;
    }
    if (!compliance_) {
        compliance_.emplace(compliance_file_);
        for (std::size_t c = 0; c < compliance_columns().size(); ++c) {
            if (compliance_->index(compliance_columns()[c]) != c) {
                compliance_->fail("column " + compliance_columns()[c] + " is not in its place");
            }
        }
    }
    auto& file = *compliance_;
    for (std::size_t r = 0; r < rows; ++r) {
        if (!file.next() || file.integer(0) != recorded.now_ns || file.natural(1) != std::uint64_t{r}) {
            file.fail("expected row " + std::to_string(r) + " of the frame taken at " +
                      std::to_string(recorded.now_ns) + " ns");
        }
        for (std::size_t s = 0; s <= r; ++s) {
            recorded.frame.compliance[compliance_index(r, s)] = static_cast<float>(file.number(2 + s));
        }
    }
}

bool FrameReader::next(RecordedFrame& recorded) {
    if (!more_) {
        return false;
    }
    recorded.now_ns = reader_.integer(order_[kTime]);
    const std::int64_t defect = reader_.integer(order_[kDefect]);
    if (defect < 0 || defect > static_cast<std::int64_t>(kLastFrameDefect)) {
        reader_.fail("column defect: unknown defect " + std::to_string(defect));
    }
    recorded.defect = static_cast<FrameDefect>(defect);
    // One row per proxy, numbered from 0; a single row numbered -1 for a frame without proxies.
    std::int64_t expected = reader_.integer(order_[kParticle]) < 0 ? -1 : 0;
    do {
        if (reader_.integer(order_[kParticle]) != expected) {
            reader_.fail("column particle: expected " + std::to_string(expected));
        }
        read_row(recorded, expected);
        ++expected;
        more_ = reader_.next();
    } while (expected > 0 && expected < static_cast<std::int64_t>(particles_of(recorded.frame)) && more_);
    // The end of the file within a frame: the run was killed there.
    if (expected < static_cast<std::int64_t>(particles_of(recorded.frame))) {
        return false;
    }
    read_compliance(recorded);
    if (recorded.defect != FrameDefect::None && find_defect(recorded.frame) == FrameDefect::None) {
        recorded.frame.stiffness =
            -1.0;  // the defect was a non-finite number, written as 0: make the frame invalid again
    }
    return true;
}

}  // namespace haptic::rt
