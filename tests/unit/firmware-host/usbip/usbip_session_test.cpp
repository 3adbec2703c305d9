#include "usbip/usbip_session.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <optional>
#include <random>

#include "emulated/make_firmware.hpp"
#include "haptic/device/emulated_device.hpp"
#include "usbip_bytes.hpp"

namespace haptic::device {
namespace {

using test::Bytes;
using test::hex;
using test::import_request;
using test::joined;
using test::submit_in;
using test::submit_out;
using test::unlink;
using test::word_at;
using test::words;
using test::zeros;
using testing::HasSubstr;

constexpr std::size_t kImportReply = 8 + 312;
constexpr std::uint32_t kStallStatus = 0xFFFFFFE0;     // -32
constexpr std::uint32_t kResetStatus = 0xFFFFFF98;     // -104
constexpr std::uint32_t kOverflowStatus = 0xFFFFFFB5;  // -75
constexpr std::uint32_t kShortStatus = 0xFFFFFF87;     // -121

/// Records received packets; replies as configured.
class ScriptedFirmware final : public Firmware {
  public:
    void receive(std::span<const std::byte> out, std::int64_t /*now_ns*/) HAPTIC_RT override {
        HAPTIC_RT_EXCEPTION_BEGIN("in a test, never in a tick")
        received.emplace_back(out.begin(), out.end());
        HAPTIC_RT_EXCEPTION_END
    }
    std::size_t reply(std::span<std::byte> in, std::int64_t /*now_ns*/) HAPTIC_RT override {
        if (replies.empty()) {
            return 0;
        }
        HAPTIC_RT_EXCEPTION_BEGIN("in a test, never in a tick")
        const Bytes reply = replies.front();
        replies.pop_front();
        const std::size_t count = std::min(in.size(), reply.size());
        std::copy_n(reply.begin(), count, in.begin());
        return count;
        HAPTIC_RT_EXCEPTION_END
    }

    std::vector<Bytes> received;
    std::deque<Bytes> replies;
};

Bytes packet(std::size_t size, int fill) {
    return Bytes(size, static_cast<std::byte>(fill));
}

Bytes in_reply(std::uint32_t sequence, std::uint32_t status, const Bytes& data) {
    return joined(
        {words({3, sequence, 0, 0, 0, status, static_cast<std::uint32_t>(data.size()), 0, 0, 0}), zeros(8), data});
}

Bytes out_reply(std::uint32_t sequence, std::uint32_t status, std::uint32_t taken) {
    return joined({words({3, sequence, 0, 0, 0, status, taken, 0, 0, 0}), zeros(8)});
}

Bytes unlink_reply(std::uint32_t sequence, std::uint32_t status) {
    return joined({words({4, sequence, 0, 0, 0, status}), zeros(24)});
}

class Session : public testing::Test {
  protected:
    Bytes take(UsbipSession& from) {
        Bytes bytes;
        bytes.swap(from.output());
        return bytes;
    }
    Bytes reply_to(const Bytes& bytes) {
        session->receive(bytes, 0);
        return take(*session);
    }
    void import_device() {
        ASSERT_EQ(reply_to(import_request()).size(), kImportReply);
        ASSERT_TRUE(session->owns_device());
    }

    ScriptedFirmware firmware;
    UsbipExport exported{BoardKind::Sh4, firmware};
    std::optional<UsbipSession> session{std::in_place, exported};
};

TEST_F(Session, ListsTheBoardWithItsInterfaceAndIsThenDone) {
    const Bytes list = reply_to(hex("0111 8005 00000000"));
    ASSERT_EQ(list.size(), 12u + 312 + 4);
    EXPECT_EQ(word_at(list, 8), 1u);
    EXPECT_EQ(Bytes(list.begin() + 12 + 300, list.begin() + 12 + 306), hex("0cec 0205 0001"));
    EXPECT_EQ(Bytes(list.end() - 4, list.end()), hex("ff 00 00 00"));
    EXPECT_TRUE(session->ended());
    EXPECT_EQ(session->reason(), "");
}

TEST_F(Session, ImportGivesTheDeviceToOneClientAndTellsOthersThatItIsBusy) {
    import_device();
    UsbipSession second(exported);
    second.receive(import_request(), 0);
    EXPECT_EQ(take(second), hex("0111 0003 00000002"));
    EXPECT_TRUE(second.ended());
    UsbipSession list(exported);
    list.receive(hex("0111 8005 00000000"), 0);
    EXPECT_EQ(take(list), hex("0111 0005 00000000 00000000"));

    session.reset();
    UsbipSession third(exported);
    third.receive(import_request(), 0);
    EXPECT_TRUE(third.owns_device());
}

TEST_F(Session, ImportOfWhatIsNotHereIsRefused) {
    EXPECT_EQ(reply_to(import_request("1-2")), hex("0111 0003 00000004"));
    EXPECT_THAT(session->reason(), HasSubstr("'1-2'"));
}

TEST_F(Session, AnUnpluggedDeviceIsNeitherListedNorGiven) {
    exported.plugged = false;
    EXPECT_EQ(reply_to(hex("0111 8005 00000000")), hex("0111 0005 00000000 00000000"));
    UsbipSession second(exported);
    second.receive(import_request(), 0);
    EXPECT_EQ(take(second), hex("0111 0003 00000004"));
}

TEST_F(Session, RubbishBeforeAnImportEndsTheSession) {
    for (const Bytes& rubbish :
         {hex("474554202f20485454502f312e310d0a"), hex("0110 8005 00000000"), hex("0111 8009 00000000")}) {
        UsbipSession each(exported);
        each.receive(rubbish, 0);
        EXPECT_TRUE(each.ended());
        EXPECT_NE(each.reason(), "");
        EXPECT_TRUE(each.output().empty());
    }
}

TEST_F(Session, RubbishAfterAnImportEndsTheSessionAndFreesTheDevice) {
    const Bytes cases[] = {
        joined({words({7, 1, test::kDevice, 0, 2, 0, 0, 0, 0, 0}), zeros(8)}),
        joined({words({1, 1, test::kDevice, 1, 6, 0, 0x7FFFFFFF, 0, 0, 0}), zeros(8)}),
        joined({words({1, 1, 0x00050005, 1, 6, 0, 512, 0, 0, 0}), zeros(8)}),
    };
    for (const Bytes& rubbish : cases) {
        session.emplace(exported);
        import_device();
        EXPECT_TRUE(reply_to(rubbish).empty());
        EXPECT_TRUE(session->ended());
        EXPECT_NE(session->reason(), "");
        EXPECT_EQ(exported.owner(), nullptr);
    }
    EXPECT_TRUE(firmware.received.empty());
}

TEST_F(Session, AnOutTransferReachesTheFirmwarePacketByPacket) {
    import_device();
    const Bytes data = joined({packet(512, 1), packet(512, 2), packet(30, 3)});
    EXPECT_EQ(reply_to(submit_out(4, 2, data)), out_reply(4, 0, 1054));
    ASSERT_EQ(firmware.received.size(), 3u);
    EXPECT_EQ(firmware.received[0], packet(512, 1));
    EXPECT_EQ(firmware.received[1], packet(512, 2));
    EXPECT_EQ(firmware.received[2], packet(30, 3));
}

TEST_F(Session, ATransferOfWholePacketsIsEndedByAnEmptyOneIfAsked) {
    import_device();
    reply_to(submit_out(4, 2, packet(512, 1), 0x40));
    ASSERT_EQ(firmware.received.size(), 2u);
    EXPECT_TRUE(firmware.received[1].empty());
    reply_to(submit_out(5, 2, packet(30, 1), 0x40));
    EXPECT_EQ(firmware.received.size(), 3u);
}

TEST_F(Session, AnInTransferWaitsForAnAnswer) {
    import_device();
    EXPECT_TRUE(reply_to(submit_in(7, 6, 512)).empty());
    EXPECT_TRUE(session->waits_for_firmware());
    firmware.replies.push_back(packet(512, 9));
    session->complete_pending(0);
    EXPECT_EQ(take(*session), in_reply(7, 0, packet(512, 9)));
    EXPECT_FALSE(session->waits_for_firmware());
}

TEST_F(Session, AnAnswerWaitsForAnInTransfer) {
    import_device();
    firmware.replies.push_back(packet(512, 9));
    EXPECT_EQ(reply_to(submit_in(7, 6, 512)), in_reply(7, 0, packet(512, 9)));
}

TEST_F(Session, AnswersGoToTransfersInTheirOrder) {
    import_device();
    reply_to(joined({submit_in(1, 6, 512), submit_in(2, 6, 512), submit_in(3, 6, 512)}));
    firmware.replies = {packet(512, 1), packet(512, 2)};
    session->complete_pending(0);
    EXPECT_EQ(take(*session), joined({in_reply(1, 0, packet(512, 1)), in_reply(2, 0, packet(512, 2))}));
    EXPECT_TRUE(session->waits_for_firmware());
}

TEST_F(Session, AShortPacketEndsATransferAndWholeOnesFillIt) {
    import_device();
    firmware.replies = {packet(512, 1), packet(32, 2)};
    EXPECT_EQ(reply_to(submit_in(1, 6, 2048)), in_reply(1, 0, joined({packet(512, 1), packet(32, 2)})));
    firmware.replies = {packet(512, 3), packet(512, 4)};
    EXPECT_EQ(reply_to(submit_in(2, 6, 1024)), in_reply(2, 0, joined({packet(512, 3), packet(512, 4)})));
    firmware.replies = {packet(32, 5)};
    EXPECT_EQ(reply_to(submit_in(3, 6, 512, 0x01)), in_reply(3, kShortStatus, packet(32, 5)));
}

TEST_F(Session, APacketThatDoesNotFitIsAnOverflow) {
    import_device();
    firmware.replies = {packet(512, 1)};
    EXPECT_EQ(reply_to(submit_in(1, 6, 54)), in_reply(1, kOverflowStatus, packet(54, 1)));
}

TEST_F(Session, UnlinkTakesAWaitingTransferBackAndItsAnswerGoesToTheNext) {
    import_device();
    reply_to(submit_in(1, 6, 512));
    EXPECT_EQ(reply_to(unlink(2, 1)), unlink_reply(2, kResetStatus));
    EXPECT_FALSE(session->waits_for_firmware());
    firmware.replies = {packet(512, 4)};
    session->complete_pending(0);
    EXPECT_TRUE(take(*session).empty()) << "a transfer that was taken back was answered";
    EXPECT_EQ(reply_to(submit_in(3, 6, 512)), in_reply(3, 0, packet(512, 4)));
}

TEST_F(Session, UnlinkOfWhatWasAnsweredSaysSo) {
    import_device();
    firmware.replies = {packet(512, 4)};
    reply_to(submit_in(1, 6, 512));
    EXPECT_EQ(reply_to(unlink(2, 1)), unlink_reply(2, 0));
    EXPECT_EQ(reply_to(unlink(3, 99)), unlink_reply(3, 0));
}

TEST_F(Session, EndpointsThatTheBoardDoesNotHaveStall) {
    import_device();
    EXPECT_EQ(reply_to(submit_in(1, 2, 512)), in_reply(1, kStallStatus, {}));
    EXPECT_EQ(reply_to(submit_out(2, 6, packet(8, 1))), out_reply(2, kStallStatus, 0));
    EXPECT_EQ(reply_to(submit_in(3, 15, 512)), in_reply(3, kStallStatus, {}));
    EXPECT_TRUE(firmware.received.empty());
}

TEST_F(Session, ControlRequestsAreAnsweredAtOnce) {
    import_device();
    EXPECT_EQ(reply_to(submit_in(1, 0, 18, 0, hex("80 06 0001 0000 1200"))),
              in_reply(1, 0, hex("12 01 0002 ff 00 00 40 ec0c 0502 0100 01 02 03 01")));
    EXPECT_EQ(reply_to(submit_in(2, 0, 8, 0, hex("80 06 0001 0000 1200"))),
              in_reply(2, 0, hex("12 01 0002 ff 00 00 40")));
    EXPECT_EQ(reply_to(submit_out(3, 0, {}, 0, hex("00 09 0100 0000 0000"))), out_reply(3, 0, 0));
    EXPECT_EQ(reply_to(submit_in(4, 0, 64, 0, hex("c0 a0 0000 0000 4000"))), in_reply(4, kStallStatus, {}));
    EXPECT_EQ(reply_to(submit_out(5, 0, packet(4, 7), 0, hex("40 a0 00e6 0000 0400"))), out_reply(5, kStallStatus, 0));
}

TEST_F(Session, AHaltStallsWhatWaitsAndWhatComesUntilItIsCleared) {
    import_device();
    reply_to(submit_in(1, 6, 512));
    EXPECT_EQ(reply_to(submit_out(2, 0, {}, 0, hex("02 03 0000 8600 0000"))),
              joined({out_reply(2, 0, 0), in_reply(1, kStallStatus, {})}));
    EXPECT_EQ(reply_to(submit_in(3, 6, 512)), in_reply(3, kStallStatus, {}));
    EXPECT_EQ(reply_to(submit_out(4, 0, {}, 0, hex("02 01 0000 8600 0000"))), out_reply(4, 0, 0));
    firmware.replies = {packet(512, 1)};
    EXPECT_EQ(reply_to(submit_in(5, 6, 512)), in_reply(5, 0, packet(512, 1)));
}

TEST_F(Session, ANewImportFindsNoHaltOfTheLast) {
    import_device();
    reply_to(submit_out(2, 0, {}, 0, hex("02 03 0000 8600 0000")));
    reply_to(submit_out(3, 0, {}, 0, hex("00 09 0000 0000 0000")));
    session.reset();
    session.emplace(exported);
    import_device();
    firmware.replies = {packet(512, 1)};
    EXPECT_EQ(reply_to(submit_in(5, 6, 512)), in_reply(5, 0, packet(512, 1)));
}

TEST_F(Session, PiecesOfAnySizeMakeTheSameAnswers) {
    const Bytes requests = joined({import_request(), submit_in(1, 0, 18, 0, hex("80 06 0001 0000 1200")),
                                   submit_out(2, 2, packet(512, 1)), submit_in(3, 6, 512), submit_in(4, 6, 512),
                                   unlink(5, 4), submit_out(6, 2, packet(700, 2)), submit_in(7, 6, 1024)});
    const auto answers = [&](std::size_t piece) {
        firmware.received.clear();
        firmware.replies = {packet(512, 1), packet(512, 2), packet(100, 3)};
        session.emplace(exported);
        for (std::size_t at = 0; at < requests.size(); at += piece) {
            session->receive(std::span(requests).subspan(at, std::min(piece, requests.size() - at)), 0);
        }
        return std::pair(take(*session), firmware.received);
    };
    const auto whole = answers(requests.size());
    EXPECT_EQ(whole.second.size(), 3u);
    for (const std::size_t piece : {1u, 2u, 7u, 47u, 48u, 49u, 512u, 600u}) {
        session.reset();
        EXPECT_EQ(answers(piece), whole) << piece;
    }
}

TEST(SimpleBoardSession, TwoShortTransfersOutMakeOneShortOneIn) {
    EmulatedDevice device({.geometry = spidar_g6_x3r()});
    const auto firmware = make_firmware(BoardKind::Simple, device);
    UsbipExport exported(BoardKind::Simple, *firmware);
    UsbipSession session(exported);
    session.receive(import_request(), 0);
    EXPECT_EQ(Bytes(session.output().begin() + 308, session.output().begin() + 312), hex("0cec 0203"));
    session.output().clear();
    // DAC code 45 (0x2d) to each motor, latch, and a request for more than the 32 bytes of the reply.
    session.receive(joined({submit_out(1, 2, joined({hex("52 2d00 2d00 2d00 2d00 2d00 2d00 2d00 2d00"), zeros(15)})),
                            submit_out(2, 2, joined({hex("51"), zeros(31)})), submit_in(3, 6, 512)}),
                    0);
    ASSERT_EQ(session.output().size(), 48u + 48 + 48 + 32);
    EXPECT_EQ(word_at(session.output(), 96 + 4), 3u);
    EXPECT_EQ(word_at(session.output(), 96 + 24), 32u) << "bytes that came";
    EXPECT_EQ(device.dac_codes()[7], 45);
}

TEST_F(Session, MoreWaitingTransfersThanItKeepsEndIt) {
    import_device();
    for (std::uint32_t i = 0; i < UsbipSession::kMaxPending; ++i) {
        reply_to(submit_in(i, 6, 512));
    }
    ASSERT_FALSE(session->ended());
    reply_to(submit_in(10'000, 6, 512));
    EXPECT_TRUE(session->ended());
    EXPECT_THAT(session->reason(), HasSubstr("pending"));
}

TEST_F(Session, EndedItTakesNothingMore) {
    reply_to(hex("0111 8005 00000000"));
    EXPECT_TRUE(reply_to(import_request()).empty());
    EXPECT_EQ(exported.owner(), nullptr);
}

TEST_F(Session, RandomBytesNeitherCrashItNorKeepTheDevice) {
    std::mt19937 random(1);  // NOLINT(bugprone-random-generator-seed): reproducible
    for (int i = 0; i < 2000; ++i) {
        session.emplace(exported);
        Bytes bytes = joined({import_request(), submit_in(1, 6, 512), submit_out(2, 2, packet(64, 1)), unlink(3, 1)});
        for (int changes = 0; changes < 1 + i % 8; ++changes) {
            bytes[random() % bytes.size()] = static_cast<std::byte>(random());
        }
        reply_to(bytes);
        session.reset();
        ASSERT_EQ(exported.owner(), nullptr);
    }
}

}  // namespace
}  // namespace haptic::device
