#include "view/request_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "view/live_view.hpp"

namespace haptic::sim::view {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST(RequestCheck, AcceptsAddressesLocalhostAndTheHostName) {
    for (const char* host : {"127.0.0.1", "127.0.0.1:7060", "192.168.1.7:80", "[::1]", "[::1]:7060", "[fe80::1]:1",
                             "localhost", "LocalHost:8080", "lab-pc", "LAB-PC:7060"}) {
        EXPECT_TRUE(host_is_own(host, "lab-pc")) << host;
    }
}

TEST(RequestCheck, RejectsEveryOtherHost) {
    for (const char* host : {"",
                             ":7060",
                             "evil.example",
                             "evil.example:7060",
                             "localhost.evil.example",
                             "lab-pc.evil.example",
                             "127.0.0.1.evil.example",
                             "127.0.0.1:",
                             "127.0.0.1:x",
                             "127.0.0.1:0",
                             "127.0.0.1:65536",
                             "127.0.0.1:80:80",
                             "[::1",
                             "[::1]x",
                             "[]",
                             "[127.0.0.1]",
                             "::1",
                             "0x7f.1",
                             "2130706433",
                             "127.0.0.1 ",
                             "user@localhost",
                             "localhost/",
                             "[localhost]"}) {
        EXPECT_FALSE(host_is_own(host, "lab-pc")) << host;
    }
    EXPECT_FALSE(host_is_own(std::string("localhost\0.evil", 15), "lab-pc"));
    EXPECT_FALSE(host_is_own("", ""));
}

TEST(RequestCheck, AcceptsAPageOnlyFromTheSameHostAndPort) {
    EXPECT_TRUE(origin_is_host("http://127.0.0.1:7060", "127.0.0.1:7060"));
    EXPECT_TRUE(origin_is_host("https://localhost:8443", "LOCALHOST:8443"));
    for (const char* origin :
         {"", "null", "http://", "http://127.0.0.1", "http://127.0.0.1:7061", "http://localhost:7060", "127.0.0.1:7060",
          "file://127.0.0.1:7060", "http://evil.example", "http://127.0.0.1:7060/",
          "http://127.0.0.1:7060.evil.example", "ws://127.0.0.1:7060"}) {
        EXPECT_FALSE(origin_is_host(origin, "127.0.0.1:7060")) << origin;
    }
}

TEST(ViewAddress, IsLoopbackByDefault) {
    EXPECT_EQ(parse_view_address("").address, "127.0.0.1");
    EXPECT_EQ(parse_view_address("").port, 7060);
    EXPECT_EQ(parse_view_address("8080").address, "127.0.0.1");
    EXPECT_EQ(parse_view_address("8080").port, 8080);
    EXPECT_EQ(parse_view_address("0.0.0.0:80").address, "0.0.0.0");
    EXPECT_EQ(parse_view_address("localhost:0").address, "127.0.0.1");
    EXPECT_EQ(parse_view_address("localhost:0").port, 0);
    EXPECT_EQ(parse_view_address("[::1]:7061").address, "::1");
    EXPECT_EQ(parse_view_address("[::1]:7061").port, 7061);
    EXPECT_FALSE(parse_view_address("8080").control);
}

TEST(ViewAddress, WarnsIfOtherMachinesCanReachIt) {
    for (const char* own : {"127.0.0.1:7060", "127.8.8.8:1", "[::1]:7060", "localhost:1", ""}) {
        EXPECT_EQ(exposure_of(parse_view_address(own)), "") << own;
    }
    for (const char* open :
         {"0.0.0.0:7060", "192.168.1.7:7060", "[::]:7060", "[fe80::1]:7060", "[::ffff:10.0.0.1]:1"}) {
        LiveViewSettings settings = parse_view_address(open);
        EXPECT_THAT(exposure_of(settings),
                    AllOf(HasSubstr(settings.address), HasSubstr("watch this run"), HasSubstr("ssh -L")));
        EXPECT_THAT(exposure_of(settings), Not(HasSubstr("change")));
        settings.control = true;
        EXPECT_THAT(exposure_of(settings), HasSubstr("change"));
    }
}

TEST(ViewAddress, ReportsTheErrorInAnAddress) {
    struct Case {
        const char* text;
        const char* why;
    };
    for (const Case& c : {Case{"x", "port"},
                          {":", "address"},
                          {"127.0.0.1:", "port"},
                          {"127.0.0.1:65536", "port"},
                          {"127.0.0.1:-1", "port"},
                          {"127.0.0.1:80x", "port"},
                          {"+80", "port"},
                          {" 80", "port"},
                          {"nowhere:80", "IP address"},
                          {"1.2.3:80", "IP address"},
                          {"::1", "brackets"},
                          {"::1:80", "brackets"},
                          {"[::1]", "brackets"},
                          {"[127.0.0.1]:80", "IPv6"},
                          {"[]:80", "IPv6"},
                          {"[::1]:", "port"}}) {
        try {
            (void)parse_view_address(c.text);
            ADD_FAILURE() << c.text << " was taken";
        } catch (const std::invalid_argument& error) {
            EXPECT_THAT(error.what(), HasSubstr(c.why)) << c.text;
            EXPECT_THAT(error.what(), HasSubstr(std::string("--view ") + c.text)) << c.text;
        }
    }
}

}  // namespace
}  // namespace haptic::sim::view
