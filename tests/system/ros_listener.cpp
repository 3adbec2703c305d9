// A foreign DDS client (eProsima Fast DDS, ROS 2's default): lists the topics of ROS 2 that it discovers, then prints
// each message of the device as "TOPIC STAMP_NS FRAME VALUE...", diagnostics with | between their texts. With a force
// it sends a wrench overlay every 5 ms instead. Nothing of it is shared with rt-core but the names.
//
//     ros_listener DOMAIN SECONDS NAMES
//     ros_listener DOMAIN SECONDS NAMES FX FY FZ
#include <fastcdr/Cdr.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

namespace {

using eprosima::fastcdr::Cdr;

constexpr std::uint32_t kLargest = 8192;  // bytes of a message

std::string text(const char* format, double value) {
    std::array<char, 40> digits{};
    std::snprintf(digits.data(), digits.size(), format, value);
    return digits.data();
}

// Each message as its definition in ROS 2 gives it, as a line.

std::string header(Cdr& cdr) {
    std::int32_t sec = 0;
    std::uint32_t nanosec = 0;
    std::string frame;
    cdr >> sec >> nanosec >> frame;
    return std::to_string(sec * 1'000'000'000ll + nanosec) + " " + frame;
}

template <int count>
std::string doubles(Cdr& cdr) {
    std::string line = header(cdr);
    for (int i = 0; i < count; ++i) {
        double value = 0.0;
        cdr >> value;
        line += text(" %.17g", value);
    }
    return line;
}

std::string joy(Cdr& cdr) {
    std::string line = header(cdr);
    std::vector<float> axes;
    std::vector<std::int32_t> buttons;
    cdr >> axes >> buttons;
    line += " " + std::to_string(axes.size());
    for (const std::int32_t button : buttons) {
        line += " " + std::to_string(button);
    }
    return line;
}

std::string diagnostics(Cdr& cdr) {
    std::string line = header(cdr);
    std::uint32_t statuses = 0;
    cdr >> statuses;
    for (std::uint32_t i = 0; i < statuses; ++i) {
        std::uint8_t level = 0;
        std::array<std::string, 3> texts;  // name, message, hardware
        std::uint32_t values = 0;
        cdr >> level >> texts[0] >> texts[1] >> texts[2] >> values;
        line += "|" + std::to_string(level) + "|" + texts[0] + "|" + texts[1] + "|" + texts[2];
        for (std::uint32_t k = 0; k < values; ++k) {
            std::string key;
            std::string value;
            cdr >> key >> value;
            line += "|" + key + "=" + value;
        }
    }
    return line;
}

struct WrenchMessage {
    std::string frame;
    std::array<double, 6> wrench{};
};

/// A type of ROS 2. Messages are read as lines; those that are written are wrenches.
class RosType : public fast::TopicDataType {
  public:
    using Read = std::string (*)(Cdr&);
    RosType(const std::string& name, Read read) : read_(read) {
        setName(name.c_str());
        m_typeSize = kLargest;
    }
    bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
        eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->max_size);
        Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        payload->encapsulation = cdr.endianness() == Cdr::BIG_ENDIANNESS ? CDR_BE : CDR_LE;
        cdr.serialize_encapsulation();
        const auto& message = *static_cast<const WrenchMessage*>(data);
        cdr << std::int32_t{0} << std::uint32_t{0} << message.frame;
        for (const double value : message.wrench) {
            cdr << value;
        }
        payload->length = static_cast<std::uint32_t>(cdr.getSerializedDataLength());
        return true;
    }
    bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
        eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
        Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        cdr.read_encapsulation();
        *static_cast<std::string*>(data) = read_(cdr);
        return true;
    }
    std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
        return [] { return kLargest; };
    }
    void* createData() override { return new std::string; }
    void deleteData(void* data) override { delete static_cast<std::string*>(data); }
    bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }

  private:
    Read read_;
};

class Discovery : public fast::DomainParticipantListener {
  public:
    void on_publisher_discovery(fast::DomainParticipant*, rtps::WriterDiscoveryInfo&& info) override {
        if (info.status == rtps::WriterDiscoveryInfo::DISCOVERED_WRITER) {
            std::printf("topic %s %s\n", info.info.topicName().c_str(), info.info.typeName().c_str());
        }
    }
};

class Printer : public fast::DataReaderListener {
  public:
    explicit Printer(std::string topic) : topic_(std::move(topic)) {}
    void on_data_available(fast::DataReader* reader) override {
        std::string line;
        fast::SampleInfo info;
        while (reader->take_next_sample(&line, &info) == ReturnCode_t::RETCODE_OK) {
            if (info.valid_data) {
                std::printf("%s %s\n", topic_.c_str(), line.c_str());
            }
        }
    }

  private:
    std::string topic_;
};

/// As ROS 2 does with ROS_LOCALHOST_ONLY=1.
fast::DomainParticipantQos loopback_only() {
    const auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.emplace_back("127.0.0.1");
    fast::DomainParticipantQos quality;
    quality.transport().use_builtin_transports = false;
    quality.transport().user_transports.push_back(udp);
    // There is no multicast: the others are asked for at once, not when they happen to announce themselves.
    rtps::Locator_t peer;
    rtps::IPLocator::setIPv4(peer, 127, 0, 0, 1);
    quality.wire_protocol().builtin.initialPeersList.push_back(peer);
    return quality;
}

/// As rclcpp asks and offers by default: reliable, the last 10.
template <class Quality>
Quality ros_quality() {
    Quality quality;
    quality.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
    quality.history().kind = fast::KEEP_LAST_HISTORY_QOS;
    quality.history().depth = 10;
    return quality;
}

struct RosTopic {
    const char* name;  // without the prefix
    const char* type;
    RosType::Read read;
};

fast::Topic* topic_of(fast::DomainParticipant* participant, const std::string& name, const RosTopic& topic) {
    const fast::TypeSupport type(new RosType(topic.type, topic.read));
    type.register_type(participant);
    return participant->create_topic("rt/" + name, topic.type, fast::TOPIC_QOS_DEFAULT);
}

constexpr const char* kWrench = "geometry_msgs::msg::dds_::WrenchStamped_";

void listen(fast::DomainParticipant* participant, const std::string& names, std::chrono::duration<double> time) {
    const std::array<RosTopic, 5> topics = {{
        {"pose", "geometry_msgs::msg::dds_::PoseStamped_", &doubles<7>},
        {"twist", "geometry_msgs::msg::dds_::TwistStamped_", &doubles<6>},
        {"wrench", kWrench, &doubles<6>},
        {"joy", "sensor_msgs::msg::dds_::Joy_", &joy},
        {"diagnostics", "diagnostic_msgs::msg::dds_::DiagnosticArray_", &diagnostics},
    }};
    fast::Subscriber* const subscriber = participant->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
    std::vector<std::unique_ptr<Printer>> printers;
    for (const RosTopic& topic : topics) {
        const bool of_device = topic.read != &diagnostics;
        printers.push_back(std::make_unique<Printer>(topic.name));
        (void)subscriber->create_datareader(
            topic_of(participant, (of_device ? names + "/" : std::string()) + topic.name, topic),
            ros_quality<fast::DataReaderQos>(), printers.back().get());
    }
    std::this_thread::sleep_for(time);
    subscriber->delete_contained_entities();
}

void push(fast::DomainParticipant* participant, const std::string& names, std::chrono::duration<double> time,
          WrenchMessage message) {
    fast::Topic* const topic =
        topic_of(participant, names + "/wrench_overlay", {"wrench_overlay", kWrench, &doubles<6>});
    fast::Publisher* const publisher = participant->create_publisher(fast::PUBLISHER_QOS_DEFAULT);
    fast::DataWriter* const writer = publisher->create_datawriter(topic, ros_quality<fast::DataWriterQos>());
    const auto end = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < end) {
        (void)writer->write(&message);
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4 && argc != 7) {
        std::fprintf(stderr, "ros_listener DOMAIN SECONDS NAMES [FX FY FZ]\n");
        return 2;
    }
    Discovery discovery;
    fast::DomainParticipant* const participant = fast::DomainParticipantFactory::get_instance()->create_participant(
        static_cast<std::uint32_t>(std::atoi(argv[1])), loopback_only(), argc == 4 ? &discovery : nullptr,
        fast::StatusMask::none());
    const std::chrono::duration<double> time(std::atof(argv[2]));
    if (argc == 4) {
        listen(participant, argv[3], time);
    } else {
        push(participant, argv[3], time, {"", {std::atof(argv[4]), std::atof(argv[5]), std::atof(argv[6])}});
    }
    participant->delete_contained_entities();
    fast::DomainParticipantFactory::get_instance()->delete_participant(participant);
}
