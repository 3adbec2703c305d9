// haptic.Session and haptic.Observer: the rings between a simulation and rt-core.

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "haptic/clock.hpp"
#include "haptic/frames.hpp"
#include "haptic/ring.hpp"
#include "haptic/ring_observer.hpp"

namespace haptic::python {
namespace {

/// The simulation's end of a session.
class PythonSession {
  public:
    explicit PythonSession(const std::string& name) : name_(name), ends_(std::in_place, name) {}

    void close() noexcept { ends_.reset(); }
    [[nodiscard]] const std::string& name() const noexcept { return name_; }

    /// None: there is no newer state than the last one.
    py::object read() {
        DeviceState state{};
        if (!ends().states.read_newest(state)) {
            return py::none();
        }
        return record_of(state);
    }

    std::uint64_t publish(const py::array_t<ContactFrame, py::array::c_style>& frame) {
        if (frame.size() != 1) {
            throw py::value_error("publish: one contact frame is needed, found " + std::to_string(frame.size()));
        }
        Ends& open = ends();
        frame_ = *frame.data();
        if (const FrameDefect defect = find_defect(frame_); defect != FrameDefect::None) {
            throw py::value_error("publish: invalid frame: " + std::string(describe(defect)));
        }
        frame_.publish_time_ns = monotonic_now_ns();
        return open.frames.publish(frame_, frame_.publish_time_ns);
    }

    void beat() { ends().frames.beat(monotonic_now_ns()); }

    [[nodiscard]] py::dict peer() {
        const RingPeer peer = ends().states.peer();
        py::dict all;
        all["session"] = peer.session;
        all["heartbeat_ns"] = peer.heartbeat_ns;
        all["pid"] = peer.writer_pid;
        all["closed"] = peer.closed;
        return all;
    }

  private:
    struct Ends {
        explicit Ends(const std::string& name) : states(name), frames(name) {}
        RingReader<DeviceState> states;
        RingWriter<ContactFrame> frames;
    };

    Ends& ends() {
        if (!ends_) {
            throw py::value_error("session " + name_ + " is closed");
        }
        return *ends_;
    }

    std::string name_;
    std::optional<Ends> ends_;
    ContactFrame frame_{};  // as published
};

/// Everything of a ring that was not returned before.
template <class Slot>
py::object new_slots(RingObserver<Slot>& ring) {
    std::vector<Slot> slots;
    Slot slot{};
    // Slots of a segment that was replaced come before attend() leaves it.
    const auto take_all = [&] {
        while (slots.size() < 2 * kRingSlots && ring.next(slot)) {
            slots.push_back(slot);
        }
    };
    take_all();
    ring.attend(monotonic_now_ns());
    if (!ring.problem().empty()) {
        throw std::runtime_error(ring.problem());
    }
    take_all();
    return records_of(slots);
}

class PythonObserver {
  public:
    explicit PythonObserver(const std::string& name) : states_(name), frames_(name) {}
    py::object states() { return new_slots(states_); }
    py::object frames() { return new_slots(frames_); }

  private:
    RingObserver<DeviceState> states_;
    RingObserver<ContactFrame> frames_;
};

}  // namespace

void bind_session(py::module_& module) {
    PYBIND11_NUMPY_DTYPE(haptic_plane, normal, offset, velocity);
    PYBIND11_NUMPY_DTYPE(haptic_proxy, rest_offset, rest_velocity, radius, position, surface_velocity, in_contact,
                         plane_count, planes);
    PYBIND11_NUMPY_DTYPE(haptic_contact_frame, sequence, session, state_sequence, state_time_ns, plane_time_ns,
                         publish_time_ns, step_ns, stiffness, torque_stiffness, static_friction, dynamic_friction,
                         body_work, proxy_count, flags, compliance_rows, reserved, proxies, compliance);
    PYBIND11_NUMPY_DTYPE(haptic_device_state, sequence, session, latch_time_ns, frame_sequence, position, orientation,
                         linear_velocity, angular_velocity, force, torque, proxy_position, tension, stiffness, scale,
                         impulse, angular_impulse, safety_state, faults, tick_flags, buttons);
    module.attr("CONTACT_FRAME") = py::dtype::of<haptic_contact_frame>();
    module.attr("DEVICE_STATE") = py::dtype::of<haptic_device_state>();

    module.def("now_ns", &monotonic_now_ns, "CLOCK_MONOTONIC in nanoseconds, the clock of every time in a frame.");
    module.def(
        "describe_state",
        [](const py::array_t<DeviceState, py::array::c_style>& state) {
            if (state.size() != 1) {
                throw py::value_error("describe_state: one device state is needed");
            }
            py::dict all;
            py::list faults;
            py::list flags;
            for (const std::string& name : fault_names(state.data()->faults)) {
                faults.append(name);
            }
            for (const std::string& name : tick_flag_names(state.data()->tick_flags)) {
                flags.append(name);
            }
            all["safety_state"] = std::string(safety_state_name(state.data()->safety_state));
            all["faults"] = faults;
            all["tick_flags"] = flags;
            return all;
        },
        py::arg("state"), "Names of a device state's safety state, faults and flags of its tick.");

    py::class_<PythonSession>(module, "Session",
                              R"(The simulation's end of a session with rt-core; a context manager.

name  1 to 64 of the characters A-Z a-z 0-9 _ -

Either process may start first, die and come back. Raises SessionError: invalid name, another process has this role, or an
invalid segment.)")
        .def(py::init<const std::string&>(), py::arg("name") = "default")
        .def("read", &PythonSession::read,
             "The newest device state (fields of haptic.DEVICE_STATE), or None if there is none newer than the last "
             "one. Never waits.")
        .def("publish", &PythonSession::publish, py::arg("frame"),
             "Publishes a contact frame (haptic.CONTACT_FRAME: haptic.contact_frame(), Simulation.frame) and returns "
             "its sequence. Never waits. Raises ValueError with the defect of an invalid frame.")
        .def("beat", &PythonSession::beat, "Signals that the simulation is alive without a new frame.")
        .def("close", &PythonSession::close, "Detaches. rt-core knows at once, and the force fades.")
        .def_property_readonly("name", &PythonSession::name)
        .def_property_readonly("peer", &PythonSession::peer,
                               "rt-core: session (0 before the first), heartbeat_ns, pid (0: none), closed.")
        .def("__enter__", [](const py::object& self) { return self; })
        .def("__exit__", [](PythonSession& session, const py::args&) { session.close(); });

    py::class_<PythonObserver>(module, "Observer",
                               R"(Sees what the two processes of a session exchange, and neither of them knows.

May be made before the session exists. A ring keeps the last 8; a gap in `sequence` is what was overwritten before it was
read.)")
        .def(py::init<const std::string&>(), py::arg("name") = "default")
        .def("states", &PythonObserver::states, "Device states that were not returned before.")
        .def("frames", &PythonObserver::frames, "Contact frames that were not returned before.");
}

}  // namespace haptic::python
