// Entities of DDS (Eclipse Cyclone DDS), each deleted with its owner. Failures throw std::runtime_error and name the
// entity.
#pragma once

#include <dds/dds.h>

#include <array>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "dds/link.hpp"  // Taken

namespace haptic::dds {

[[noreturn]] inline void fail(const std::string& what, dds_return_t error) {
    throw std::runtime_error("DDS: " + what + ": " + dds_strretcode(-error));
}

/// An entity of DDS, or an error that names it.
class Entity {
  public:
    Entity(dds_entity_t entity, const std::string& what) : entity_(entity) {
        if (entity < 0) {
            fail(what, entity);
        }
    }
    Entity(Entity&& other) noexcept : entity_(std::exchange(other.entity_, 0)) {}
    Entity& operator=(Entity&& other) noexcept {
        std::swap(entity_, other.entity_);
        return *this;
    }
    ~Entity() {
        if (entity_ > 0) {
            (void)dds_delete(entity_);
        }
    }
    [[nodiscard]] dds_entity_t get() const noexcept { return entity_; }

  private:
    dds_entity_t entity_;
};

inline Entity participant_in(std::uint32_t domain) {
    return {dds_create_participant(domain, nullptr, nullptr), "no participant"};
}

/// Quality of service: best effort, the newest `depth` messages win.
class Quality {
  public:
    explicit Quality(std::int32_t depth) : qos_(dds_create_qos()) {
        dds_qset_reliability(qos_.get(), DDS_RELIABILITY_BEST_EFFORT, 0);
        dds_qset_history(qos_.get(), DDS_HISTORY_KEEP_LAST, depth);
    }
    /// Lost messages are sent again, while they are among the newest; the writer never waits.
    Quality&& reliable() && {
        dds_qset_reliability(qos_.get(), DDS_RELIABILITY_RELIABLE, 0);
        return std::move(*this);
    }
    /// What waited longer for its reader is dropped.
    Quality&& lifespan(std::int64_t time_ns) && {
        dds_qset_lifespan(qos_.get(), time_ns);
        return std::move(*this);
    }
    Quality&& partition(const std::string& name) && {
        dds_qset_partition1(qos_.get(), name.c_str());
        return std::move(*this);
    }
    [[nodiscard]] const dds_qos_t* get() const noexcept { return qos_.get(); }

  private:
    struct Delete {
        void operator()(dds_qos_t* qos) const noexcept { dds_delete_qos(qos); }
    };
    std::unique_ptr<dds_qos_t, Delete> qos_;
};

inline Entity topic_of(const Entity& participant, const dds_topic_descriptor_t& type, const std::string& name) {
    return {dds_create_topic(participant.get(), &type, name.c_str(), nullptr, nullptr), "no topic " + name};
}

/// Writes one topic. `Message` is the structure that idlc made.
template <class Message>
class Sender {
  public:
    Sender(const Entity& participant, const dds_topic_descriptor_t& type, const std::string& name,
           const Quality& quality)
        : topic_(topic_of(participant, type, name)),
          publisher_(dds_create_publisher(participant.get(), quality.get(), nullptr), "no publisher"),
          writer_(dds_create_writer(publisher_.get(), topic_.get(), quality.get(), nullptr), "no writer of " + name) {}

    void send(const Message& message) {
        if (const dds_return_t status = dds_write(writer_.get(), &message); status < 0) {
            fail("a message was not sent", status);
        }
    }

  private:
    Entity topic_;
    Entity publisher_;
    Entity writer_;
};

/// Reads one topic.
template <class Message>
class Receiver {
  public:
    Receiver(const Entity& participant, const dds_topic_descriptor_t& type, const std::string& name,
             const Quality& quality)
        : topic_(topic_of(participant, type, name)),
          subscriber_(dds_create_subscriber(participant.get(), quality.get(), nullptr), "no subscriber"),
          reader_(dds_create_reader(subscriber_.get(), topic_.get(), quality.get(), nullptr), "no reader of " + name) {}

    /// Calls read(message) for the oldest message, which may refuse it.
    template <class Read>
    Taken take(const Read& read) {
        std::array<void*, 1> sample{};
        dds_sample_info_t info;
        const dds_return_t count = dds_take(reader_.get(), sample.data(), &info, 1, 1);
        if (count < 0) {
            fail("a message was not received", count);
        }
        if (count == 0) {
            return Taken::Nothing;
        }
        const bool valid = info.valid_data && read(*static_cast<const Message*>(sample[0]));
        (void)dds_return_loan(reader_.get(), sample.data(), count);
        // The end of a writer comes without data.
        return !info.valid_data ? Taken::Nothing : valid ? Taken::Message : Taken::Refused;
    }

    [[nodiscard]] bool matched() const {
        dds_subscription_matched_status_t status{};
        return dds_get_subscription_matched_status(reader_.get(), &status) == DDS_RETCODE_OK &&
               status.current_count > 0;
    }
    [[nodiscard]] dds_entity_t get() const noexcept { return reader_.get(); }

  private:
    Entity topic_;
    Entity subscriber_;
    Entity reader_;
};

/// Waits for data of any of its readers.
class Waiting {
  public:
    Waiting(const Entity& participant, std::initializer_list<dds_entity_t> readers)
        : set_(dds_create_waitset(participant.get()), "no waitset") {
        for (const dds_entity_t reader : readers) {
            conditions_.emplace_back(dds_create_readcondition(reader, DDS_ANY_STATE), "no condition");
            (void)dds_waitset_attach(set_.get(), conditions_.back().get(), 0);
        }
    }
    void wait(std::int64_t timeout_ns) { (void)dds_waitset_wait(set_.get(), nullptr, 0, timeout_ns); }

  private:
    Entity set_;
    std::vector<Entity> conditions_;
};

}  // namespace haptic::dds
