#include <array>
#include <cstdio>
#include <exception>
#include <string_view>

#include "haptic/clock.hpp"
#include "haptic/haptic.h"
#include "haptic/ring.hpp"
#include "haptic/ring_observer.hpp"

struct haptic_contact_writer {
    haptic::RingWriter<haptic::ContactFrame> ring;
};

struct haptic_state_reader {
    haptic::RingReader<haptic::DeviceState> ring;
    haptic::DeviceState scratch;
};

struct haptic_contact_observer {
    haptic::RingObserver<haptic::ContactFrame> ring;
};

struct haptic_state_observer {
    haptic::RingObserver<haptic::DeviceState> ring;
};

namespace {

/// Fixed size, so that reporting an error cannot fail.
std::array<char, 1024>& last_error() noexcept {
    thread_local std::array<char, 1024> text{};
    return text;
}

void set_last_error(const char* what) noexcept {
    std::snprintf(last_error().data(), last_error().size(), "%s", what);
}

/// Calls a function that may throw. On an exception stores its text and returns `otherwise`.
template <class Value, class Function>
Value guarded(Value otherwise, const Function& function) noexcept {
    try {
        return function();
    } catch (const std::exception& error) {
        set_last_error(error.what());
    } catch (...) {
        set_last_error("unknown error");
    }
    return otherwise;
}

bool is_null(const void* argument, const char* what) noexcept {
    if (argument == nullptr) {
        set_last_error(what);
    }
    return argument == nullptr;
}

void set_invalid_frame(const char* function, haptic::FrameDefect defect) noexcept {
    const std::string_view why = haptic::describe(defect);
    std::snprintf(last_error().data(), last_error().size(), "%s: invalid frame: %.*s", function,
                  static_cast<int>(why.size()), why.data());
}

/// Next slot of an observed ring: 1 with a slot, 0 without one, -1 if the segment cannot be observed.
template <class Slot>
int observe_next(haptic::RingObserver<Slot>& ring, Slot& slot, std::int64_t now_ns) noexcept {
    return guarded(-1, [&] {
        // attend() may leave a segment that was replaced: its last slots come first.
        if (ring.next(slot)) {
            return 1;
        }
        ring.attend(now_ns);
        if (!ring.problem().empty()) {
            set_last_error(ring.problem().c_str());
            return -1;
        }
        return ring.next(slot) ? 1 : 0;
    });
}

}  // namespace

extern "C" {

const char* haptic_version(void) {
    return HAPTIC_VERSION;
}

uint32_t haptic_abi_version(void) {
    return HAPTIC_ABI_VERSION;
}

const char* haptic_last_error(void) {
    return last_error().data();
}

int64_t haptic_now_ns(void) {
    return haptic::monotonic_now_ns();
}

haptic_contact_writer* haptic_contact_writer_open(const char* session) {
    if (is_null(session, "haptic_contact_writer_open: session is NULL")) {
        return nullptr;
    }
    return guarded<haptic_contact_writer*>(
        nullptr, [session] { return new haptic_contact_writer{haptic::RingWriter<haptic::ContactFrame>(session)}; });
}

void haptic_contact_writer_close(haptic_contact_writer* writer) {
    delete writer;
}

uint64_t haptic_contact_writer_publish(haptic_contact_writer* writer, haptic_contact_frame* frame, int64_t now_ns) {
    if (is_null(writer, "haptic_contact_writer_publish: writer is NULL") ||
        is_null(frame, "haptic_contact_writer_publish: frame is NULL")) {
        return 0;
    }
    if (const haptic::FrameDefect defect = haptic::find_defect(*frame); defect != haptic::FrameDefect::None) {
        set_invalid_frame("haptic_contact_writer_publish", defect);
        return 0;
    }
    frame->publish_time_ns = now_ns;
    return writer->ring.publish(*frame, now_ns);
}

int haptic_contact_writer_beat(haptic_contact_writer* writer, int64_t now_ns) {
    if (is_null(writer, "haptic_contact_writer_beat: writer is NULL")) {
        return -1;
    }
    writer->ring.beat(now_ns);
    return 0;
}

haptic_state_reader* haptic_state_reader_open(const char* session) {
    if (is_null(session, "haptic_state_reader_open: session is NULL")) {
        return nullptr;
    }
    return guarded<haptic_state_reader*>(
        nullptr, [session] { return new haptic_state_reader{haptic::RingReader<haptic::DeviceState>(session), {}}; });
}

void haptic_state_reader_close(haptic_state_reader* reader) {
    delete reader;
}

int haptic_state_reader_read(haptic_state_reader* reader, haptic_device_state* state) {
    if (is_null(reader, "haptic_state_reader_read: reader is NULL") ||
        is_null(state, "haptic_state_reader_read: state is NULL")) {
        return -1;
    }
    // Read into a scratch copy: a read that is overtaken by the writer leaves its target inconsistent.
    if (!reader->ring.read_newest(reader->scratch)) {
        return 0;
    }
    *state = reader->scratch;
    return 1;
}

int haptic_state_reader_peer(const haptic_state_reader* reader, haptic_peer* peer) {
    if (is_null(reader, "haptic_state_reader_peer: reader is NULL") ||
        is_null(peer, "haptic_state_reader_peer: peer is NULL")) {
        return -1;
    }
    const haptic::RingPeer found = reader->ring.peer();
    *peer = {found.session, found.heartbeat_ns, found.writer_pid, found.closed ? 1u : 0u};
    return 0;
}

haptic_state_observer* haptic_state_observer_open(const char* session) {
    if (is_null(session, "haptic_state_observer_open: session is NULL")) {
        return nullptr;
    }
    return guarded<haptic_state_observer*>(
        nullptr, [session] { return new haptic_state_observer{haptic::RingObserver<haptic::DeviceState>(session)}; });
}

void haptic_state_observer_close(haptic_state_observer* observer) {
    delete observer;
}

int haptic_state_observer_next(haptic_state_observer* observer, haptic_device_state* state, int64_t now_ns) {
    if (is_null(observer, "haptic_state_observer_next: observer is NULL") ||
        is_null(state, "haptic_state_observer_next: state is NULL")) {
        return -1;
    }
    return observe_next(observer->ring, *state, now_ns);
}

haptic_contact_observer* haptic_contact_observer_open(const char* session) {
    if (is_null(session, "haptic_contact_observer_open: session is NULL")) {
        return nullptr;
    }
    return guarded<haptic_contact_observer*>(nullptr, [session] {
        return new haptic_contact_observer{haptic::RingObserver<haptic::ContactFrame>(session)};
    });
}

void haptic_contact_observer_close(haptic_contact_observer* observer) {
    delete observer;
}

int haptic_contact_observer_next(haptic_contact_observer* observer, haptic_contact_frame* frame, int64_t now_ns) {
    if (is_null(observer, "haptic_contact_observer_next: observer is NULL") ||
        is_null(frame, "haptic_contact_observer_next: frame is NULL")) {
        return -1;
    }
    const int found = observe_next(observer->ring, *frame, now_ns);
    if (found == 1) {
        if (const haptic::FrameDefect defect = haptic::find_defect(*frame); defect != haptic::FrameDefect::None) {
            set_invalid_frame("haptic_contact_observer_next", defect);
            return -1;
        }
    }
    return found;
}

}  // extern "C"
