// The link in a build without Cyclone DDS: it cannot be made, and says why.
#include <stdexcept>

#include "dds/link.hpp"

namespace haptic {

struct LinkDomain::State {};
struct DeviceLink::State {};
struct SimulationLink::State {};

namespace {

[[noreturn]] void fail() {
    throw std::runtime_error(
        "this program was built without Cyclone DDS, which connects it to other machines; install "
        "cyclonedds-dev and cyclonedds-tools, and build it again");
}

}  // namespace

void check(const LinkSettings& /*settings*/) {}

LinkDomain::LinkDomain(const LinkSettings& /*settings*/) {
    fail();
}
LinkDomain::LinkDomain(LinkDomain&&) noexcept = default;
LinkDomain& LinkDomain::operator=(LinkDomain&&) noexcept = default;
LinkDomain::~LinkDomain() = default;

DeviceLink::DeviceLink(const LinkSettings& /*settings*/) {
    fail();
}
DeviceLink::DeviceLink(DeviceLink&&) noexcept = default;
DeviceLink& DeviceLink::operator=(DeviceLink&&) noexcept = default;
DeviceLink::~DeviceLink() = default;
void DeviceLink::wait(std::int64_t /*timeout_ns*/) {}
void DeviceLink::send(const DeviceState& /*state*/) {}
void DeviceLink::send(const ClockReplyMessage& /*reply*/) {}
Taken DeviceLink::take(ContactFrame& /*frame*/) {
    return Taken::Nothing;
}
Taken DeviceLink::take(ClockQueryMessage& /*query*/) {
    return Taken::Nothing;
}
bool DeviceLink::matched() const {
    return false;
}

SimulationLink::SimulationLink(const LinkSettings& /*settings*/) {
    fail();
}
SimulationLink::SimulationLink(SimulationLink&&) noexcept = default;
SimulationLink& SimulationLink::operator=(SimulationLink&&) noexcept = default;
SimulationLink::~SimulationLink() = default;
void SimulationLink::wait(std::int64_t /*timeout_ns*/) {}
void SimulationLink::send(const ContactFrame& /*frame*/, std::int64_t /*clock_uncertainty_ns*/) {}
void SimulationLink::send(const ClockQueryMessage& /*query*/) {}
Taken SimulationLink::take(DeviceState& /*state*/) {
    return Taken::Nothing;
}
Taken SimulationLink::take(ClockReplyMessage& /*reply*/) {
    return Taken::Nothing;
}
bool SimulationLink::matched() const {
    return false;
}

}  // namespace haptic
