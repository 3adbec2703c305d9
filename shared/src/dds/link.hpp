// Link: the two ends of a session on different machines, by DDS (Eclipse Cyclone DDS). shared/idl/haptic_link.idl has
// the topics, shared/docs/dds.md their meaning. Everything is best effort and the newest wins.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "haptic/frames.hpp"

namespace haptic {

struct LinkSettings {
    std::string session = "default";
    std::string interface = "lo";      // the only one that is used
    std::vector<std::string> peers{};  // addresses of the other machine, if the interface has no multicast
    std::uint32_t domain = 0;          // 0..232, of DDS
};

/// Throws std::invalid_argument for a session name, an interface or a peer with other than [A-Za-z0-9_.:-] characters.
void check(const LinkSettings& settings);

/// A DDS domain in this process. One process has one of each number. Throws std::runtime_error if DDS cannot use the
/// interface.
class LinkDomain {
  public:
    explicit LinkDomain(const LinkSettings& settings);
    LinkDomain(LinkDomain&&) noexcept;
    LinkDomain& operator=(LinkDomain&&) noexcept;
    ~LinkDomain();

  private:
    struct State;
    std::unique_ptr<State> state_;
};

struct ClockQueryMessage {
    std::uint64_t asker = 0;   // a number for each start of a simulation
    std::int64_t sent_ns = 0;  // clock of the simulation's machine
};

struct ClockReplyMessage {
    std::uint64_t asker = 0;
    std::int64_t sent_ns = 0;      // of the query
    std::int64_t received_ns = 0;  // clock of rt-core's machine
    std::int64_t replied_ns = 0;
};

/// What came of a take.
enum class Taken : std::uint8_t {
    Nothing,
    Message,
    Refused  // it was no valid message: another version, inconsistent counts, an invalid frame
};

/// The end at rt-core. No function waits but wait().
class DeviceLink {
  public:
    explicit DeviceLink(const LinkSettings& settings);
    DeviceLink(DeviceLink&&) noexcept;
    DeviceLink& operator=(DeviceLink&&) noexcept;
    ~DeviceLink();

    /// Until a message arrives, at most as long.
    void wait(std::int64_t timeout_ns);
    void send(const DeviceState& state);
    void send(const ClockReplyMessage& reply);
    /// The newest frame. Its sequence is that of the simulation's ring.
    [[nodiscard]] Taken take(ContactFrame& frame);
    [[nodiscard]] Taken take(ClockQueryMessage& query);
    /// A simulation is connected.
    [[nodiscard]] bool matched() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

/// The end at the simulation.
class SimulationLink {
  public:
    explicit SimulationLink(const LinkSettings& settings);
    SimulationLink(SimulationLink&&) noexcept;
    SimulationLink& operator=(SimulationLink&&) noexcept;
    ~SimulationLink();

    void wait(std::int64_t timeout_ns);
    void send(const ContactFrame& frame, std::int64_t clock_uncertainty_ns);
    void send(const ClockQueryMessage& query);
    /// The newest state.
    [[nodiscard]] Taken take(DeviceState& state);
    [[nodiscard]] Taken take(ClockReplyMessage& reply);
    [[nodiscard]] bool matched() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace haptic
