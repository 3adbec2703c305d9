// A foreign DDS client (eProsima Fast DDS, ROS 2's default): lists the topics of ROS 2 that it discovers, then prints
// each wrench that it receives as "wrench STAMP_NS FRAME FX FY FZ TX TY TZ". Nothing of it is shared with rt-core but
// the names.
//
//     ros_listener DOMAIN SECONDS NAMES
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

namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

namespace {

struct WrenchStamped {
    std::int32_t sec = 0;
    std::uint32_t nanosec = 0;
    std::string frame;
    std::array<double, 6> wrench{};
};

/// geometry_msgs/WrenchStamped, as its message definition gives it.
class WrenchType : public fast::TopicDataType {
  public:
    WrenchType() {
        setName("geometry_msgs::msg::dds_::WrenchStamped_");
        m_typeSize = 1024;
    }
    bool serialize(void*, rtps::SerializedPayload_t*) override { return false; }
    bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
        auto& to = *static_cast<WrenchStamped*>(data);
        eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
        eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
        cdr.read_encapsulation();
        cdr >> to.sec >> to.nanosec >> to.frame;
        for (double& value : to.wrench) {
            cdr >> value;
        }
        return true;
    }
    std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
        return [] { return 1024u; };
    }
    void* createData() override { return new WrenchStamped; }
    void deleteData(void* data) override { delete static_cast<WrenchStamped*>(data); }
    bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
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
    void on_data_available(fast::DataReader* reader) override {
        WrenchStamped data;
        fast::SampleInfo info;
        while (reader->take_next_sample(&data, &info) == ReturnCode_t::RETCODE_OK) {
            if (info.valid_data) {
                const auto& w = data.wrench;
                std::printf("wrench %lld %s %.9g %.9g %.9g %.9g %.9g %.9g\n", data.sec * 1'000'000'000ll + data.nanosec,
                            data.frame.c_str(), w[0], w[1], w[2], w[3], w[4], w[5]);
            }
        }
    }
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

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) {
        std::fprintf(stderr, "ros_listener DOMAIN SECONDS NAMES\n");
        return 2;
    }
    Discovery discovery;
    fast::DomainParticipant* const participant = fast::DomainParticipantFactory::get_instance()->create_participant(
        static_cast<std::uint32_t>(std::atoi(argv[1])), loopback_only(), &discovery, fast::StatusMask::none());
    const fast::TypeSupport type(new WrenchType);
    type.register_type(participant);
    fast::Topic* const topic = participant->create_topic(std::string("rt/") + argv[3] + "/wrench", type.get_type_name(),
                                                         fast::TOPIC_QOS_DEFAULT);
    // As rclcpp asks by default: reliable, the last 10.
    fast::DataReaderQos quality;
    quality.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
    quality.history().kind = fast::KEEP_LAST_HISTORY_QOS;
    quality.history().depth = 10;
    Printer printer;
    fast::Subscriber* const subscriber = participant->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
    fast::DataReader* const reader = subscriber->create_datareader(topic, quality, &printer);
    std::this_thread::sleep_for(std::chrono::duration<double>(std::atof(argv[2])));
    subscriber->delete_datareader(reader);
    participant->delete_contained_entities();
    fast::DomainParticipantFactory::get_instance()->delete_participant(participant);
}
