#include "haptic/rt/recording.hpp"

#include <algorithm>

#include "haptic/types.hpp"

namespace haptic::rt {
namespace {

constexpr double kMicrosecondsPerNanosecond = 1e-3;
constexpr double kMillisecondsPerNanosecond = 1e-6;

}  // namespace

const std::vector<std::string>& record_columns() {
    static const std::vector<std::string> columns = {
        "time_s", "x_m",   "y_m",   "z_m",   "qw",        "qx",           "qy",        "qz",         "fx_n", "fy_n",
        "fz_n",   "tx_nm", "ty_nm", "tz_nm", "proxy_x_m", "proxy_y_m",    "proxy_z_m", "t0_n",       "t1_n", "t2_n",
        "t3_n",   "t4_n",  "t5_n",  "t6_n",  "t7_n",      "frame_age_ms", "period_us", "compute_us", "flags"};
    return columns;
}

std::array<double, kRecordColumns> record_row(const TickRecord& record, std::int64_t start_ns) {
    const Vec3& p = record.pose.position;
    const Quat& q = record.pose.orientation;
    const Vec3& f = record.rendered.force;
    const Vec3& t = record.rendered.torque;
    const StringArray& s = record.tensions;
    const double age_ms =
        record.frame_age_ns < 0 ? -1.0 : static_cast<double>(record.frame_age_ns) * kMillisecondsPerNanosecond;
    return {seconds(record.now_ns - start_ns),
            p.x,
            p.y,
            p.z,
            q.w,
            q.x,
            q.y,
            q.z,
            f.x,
            f.y,
            f.z,
            t.x,
            t.y,
            t.z,
            record.proxy.x,
            record.proxy.y,
            record.proxy.z,
            s[0],
            s[1],
            s[2],
            s[3],
            s[4],
            s[5],
            s[6],
            s[7],
            age_ms,
            static_cast<double>(record.period_ns) * kMicrosecondsPerNanosecond,
            static_cast<double>(record.compute_ns) * kMicrosecondsPerNanosecond,
            static_cast<double>(record.flags)};
}

RecordFile::RecordFile(const std::filesystem::path& file, Recorder& recorder)
    : writer_(file, record_columns()), recorder_(&recorder) {}

void RecordFile::drain() {
    TickRecord record;
    while (recorder_->pop(record)) {
        if (!started_) {
            start_ns_ = record.now_ns;
            started_ = true;
        }
        writer_.row(record_row(record, start_ns_));
    }
}

void RecordFile::close() {
    drain();
    writer_.close();
}

void write_black_box(const std::filesystem::path& file, const BlackBox& box) {
    CsvWriter writer(file, record_columns());
    for (std::size_t i = 0; i < box.size(); ++i) {
        writer.row(record_row(box.at(i), box.at(0).now_ns));
    }
    writer.close();
}

}  // namespace haptic::rt
