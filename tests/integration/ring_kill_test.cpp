// Either end of a ring is killed at random times, hundreds of times, and comes back: the other end continues and sees
// only complete frames.
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <memory>
#include <random>

#include "haptic/clock.hpp"
#include "haptic/ring.hpp"
#include "ring_pattern.hpp"
#include "ring_session.hpp"

namespace haptic {
namespace {

using test::is_whole;
using test::PatternWriter;
using test::RingSession;
using test::Shared;
using test::start_process;
using test::wait_for;

constexpr int kKills = 200;
constexpr unsigned kProcesses = 8;  // that attach and detach concurrently
constexpr int kRounds = 50;
constexpr std::int64_t kPatience = 10 * kNanosecondsPerSecond;  // ns

/// When the next process is killed: one in four during start-up, the others while working.
class Death {
  public:
    explicit Death(std::mt19937& random) : at_start_(random() % 4 == 0), delay_ns_(draw(random, at_start_)) {}

    /// Polled while the process lives; `working` once it was first seen at work.
    bool has_come(bool working) {
        const std::int64_t now_ns = monotonic_now_ns();
        if (begin_ns_ == 0 && (at_start_ || working)) {
            begin_ns_ = now_ns;
        }
        return begin_ns_ != 0 ? now_ns - begin_ns_ >= delay_ns_ : now_ns - born_ns_ > kPatience;
    }

  private:
    static std::int64_t draw(std::mt19937& random, bool at_start) {
        return std::uniform_int_distribution<std::int64_t>(0, at_start ? 400'000 : 3'000'000)(random);
    }

    bool at_start_;
    std::int64_t delay_ns_;
    std::int64_t born_ns_ = monotonic_now_ns();
    std::int64_t begin_ns_ = 0;
};

[[noreturn]] void publish_for_ever(const std::string& session) {
    PatternWriter<ContactFrame> writer(session);
    auto frame = std::make_unique<ContactFrame>();
    while (true) {
        writer.publish_pattern(*frame, monotonic_now_ns());
    }
}

/// Checks of a reader of many successive writers.
struct ReaderChecks {
    std::uint64_t torn = 0;
    std::uint64_t not_rising = 0;
    std::uint64_t last = 0;
    std::int64_t last_heartbeat_ns = 0;
    std::uint64_t heartbeats_back = 0;

    void check(const ContactFrame& frame, const RingPeer& peer) {
        torn += is_whole(frame) ? 0u : 1u;
        not_rising += frame.sequence > last ? 0u : 1u;
        last = frame.sequence;
        // 0: a writer that has attached but not yet published.
        heartbeats_back += peer.heartbeat_ns == 0 || peer.heartbeat_ns >= last_heartbeat_ns ? 0u : 1u;
        last_heartbeat_ns = std::max(last_heartbeat_ns, peer.heartbeat_ns);
    }
};

TEST(RingKill, TheReaderGoesOnThroughTwoHundredKilledWriters) {
    const RingSession session;
    auto frame = std::make_unique<ContactFrame>();
    ReaderChecks checks;
    std::uint64_t last_session = 0;
    int sessions_seen = 0;
    {
        RingReader<ContactFrame> reader(session.name());
        std::mt19937 random(11);
        const auto take = [&] {
            if (reader.read_newest(*frame)) {
                checks.check(*frame, reader.peer());
                sessions_seen += frame->session != last_session ? 1 : 0;
                last_session = frame->session;
            }
        };
        for (int i = 0; i < kKills; ++i) {
            const pid_t writer = start_process([&]() -> int { publish_for_ever(session.name()); });
            Death death(random);
            for (const int before = sessions_seen; !death.has_come(sessions_seen != before);) {
                take();
            }
            ASSERT_EQ(kill(writer, SIGKILL), 0);
            const int status = wait_for(writer);
            ASSERT_TRUE(WIFSIGNALED(status)) << "the writer ended by itself with status " << status;
            take();
        }
        // A writer that lives: the ring works as if new.
        PatternWriter<ContactFrame> writer(session.name());
        const std::uint64_t sequence = writer.publish_pattern(*frame, monotonic_now_ns());
        EXPECT_GT(sequence, checks.last);
        ASSERT_TRUE(reader.read_newest(*frame));
        EXPECT_EQ(frame->sequence, sequence);
        EXPECT_EQ(frame->session, writer.session_id());
    }
    EXPECT_EQ(checks.torn, 0u);
    EXPECT_EQ(checks.not_rising, 0u);
    EXPECT_EQ(checks.heartbeats_back, 0u);
    EXPECT_GT(sessions_seen, kKills / 2) << "most writers must have lived long enough to be heard";
    EXPECT_LE(sessions_seen, kKills);
    EXPECT_FALSE(session.exists(RingKind::Contact));
    std::printf("%d of %d writers were heard; the last frame was %llu\n", sessions_seen, kKills,
                static_cast<unsigned long long>(checks.last));
}

struct ReaderReport {
    std::atomic<std::uint64_t> attached{0};
    std::atomic<std::uint64_t> frames{0};
    std::atomic<std::uint64_t> torn{0};
    std::atomic<std::uint64_t> not_rising{0};
    std::atomic<std::uint64_t> last{0};
};

[[noreturn]] void read_for_ever(const std::string& session, ReaderReport& report) {
    RingReader<ContactFrame> reader(session);
    report.attached.fetch_add(1);
    auto frame = std::make_unique<ContactFrame>();
    bool first = true;
    while (true) {
        if (!reader.read_newest(*frame)) {
            sched_yield();
            continue;
        }
        report.frames.fetch_add(1);
        report.torn.fetch_add(is_whole(*frame) ? 0u : 1u);
        // The previous reader may have seen the first frame.
        const std::uint64_t last = report.last.load();
        report.not_rising.fetch_add(frame->sequence > last || (first && frame->sequence == last) ? 0u : 1u);
        report.last.store(frame->sequence);
        first = false;
    }
}

TEST(RingKill, TheWriterGoesOnThroughTwoHundredKilledReaders) {
    const RingSession session;
    const Shared<ReaderReport> report;
    std::uint64_t published = 0;
    {
        PatternWriter<ContactFrame> writer(session.name());
        auto frame = std::make_unique<ContactFrame>();
        std::mt19937 random(12);
        for (int i = 0; i < kKills; ++i) {
            const pid_t reader = start_process([&]() -> int { read_for_ever(session.name(), *report); });
            Death death(random);
            const std::uint64_t before = report->attached.load();
            while (!death.has_come(report->attached.load() != before)) {
                ASSERT_EQ(writer.publish_pattern(*frame, monotonic_now_ns()), published + 1);
                ++published;
            }
            ASSERT_EQ(kill(reader, SIGKILL), 0);
            const int status = wait_for(reader);
            ASSERT_TRUE(WIFSIGNALED(status)) << "the reader ended by itself with status " << status;
        }
        // A reader that lives sees the newest frame.
        RingReader<ContactFrame> reader(session.name());
        ASSERT_TRUE(reader.read_newest(*frame));
        EXPECT_EQ(frame->sequence, published);
        EXPECT_TRUE(is_whole(*frame));
    }
    EXPECT_EQ(report->torn.load(), 0u);
    EXPECT_EQ(report->not_rising.load(), 0u);
    EXPECT_GT(report->attached.load(), static_cast<std::uint64_t>(kKills / 2));
    EXPECT_GT(report->frames.load(), report->attached.load());
    EXPECT_FALSE(session.exists(RingKind::Contact));
    std::printf("%llu of %d readers attached and took %llu of %llu frames\n",
                static_cast<unsigned long long>(report->attached.load()), kKills,
                static_cast<unsigned long long>(report->frames.load()), static_cast<unsigned long long>(published));
}

/// Waits for a condition that another process causes.
template <class Condition>
bool comes_true(const Condition& condition) {
    const std::int64_t deadline_ns = monotonic_now_ns() + kPatience;
    while (!condition()) {
        if (monotonic_now_ns() > deadline_ns) {
            return false;
        }
        sched_yield();
    }
    return true;
}

TEST(RingKill, WhatTwoKilledProcessesLeaveIsTakenUpAndRemoved) {
    const RingSession session;
    const Shared<ReaderReport> report;
    const pid_t writer = start_process([&]() -> int { publish_for_ever(session.name()); });
    const pid_t reader = start_process([&]() -> int { read_for_ever(session.name(), *report); });
    EXPECT_TRUE(comes_true([&] { return report->frames.load() > 10; }));
    kill(writer, SIGKILL);
    kill(reader, SIGKILL);
    wait_for(writer);
    wait_for(reader);
    ASSERT_TRUE(session.exists(RingKind::Contact));
    struct stat status{};
    ASSERT_EQ(stat(session.path(RingKind::Contact).c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 07777u, 0600u);
    {
        auto frame = std::make_unique<ContactFrame>();
        RingWriter<ContactFrame> next(session.name());
        EXPECT_GT(next.publish(*frame, 0), report->last.load());
    }
    EXPECT_FALSE(session.exists(RingKind::Contact));
}

TEST(RingKill, AStoppedReaderDoesNotHoldTheWriterUp) {
    const RingSession session;
    const Shared<ReaderReport> report;
    PatternWriter<ContactFrame> writer(session.name());
    auto frame = std::make_unique<ContactFrame>();
    const pid_t reader = start_process([&]() -> int { read_for_ever(session.name(), *report); });
    std::uint64_t published = 0;
    EXPECT_TRUE(comes_true([&] {
        published = writer.publish_pattern(*frame, 0);
        return report->frames.load() > 10;
    }));
    kill(reader, SIGSTOP);
    for (int i = 0; i < 1000; ++i) {
        ASSERT_EQ(writer.publish_pattern(*frame, 0), published + 1);
        ++published;
    }
    kill(reader, SIGCONT);
    EXPECT_TRUE(comes_true([&] { return report->last.load() == published; }));
    EXPECT_EQ(report->torn.load(), 0u);
    kill(reader, SIGKILL);
    wait_for(reader);
}

TEST(RingKill, ManyProcessesThatStartAndEndAtOnceShareTheRolesAndLeaveNothing) {
    const RingSession session;
    // Each process tries both roles repeatedly. A role is free or taken; any other result is an error.
    const auto come_and_go = [&](unsigned seed) {
        std::mt19937 random(seed);
        auto frame = std::make_unique<ContactFrame>();
        for (int i = 0; i < kRounds; ++i) {
            try {
                if (random() % 2 == 0) {
                    RingWriter<ContactFrame> writer(session.name());
                    writer.publish(*frame, 0);
                } else {
                    RingReader<ContactFrame> reader(session.name());
                    static_cast<void>(reader.read_newest(*frame));
                }
            } catch (const RingError& error) {
                if (error.kind() != RingError::Kind::RoleTaken) {
                    throw;
                }
            }
        }
        return 0;
    };
    std::array<pid_t, kProcesses> children{};
    for (unsigned i = 0; i < kProcesses; ++i) {
        children[i] = start_process([&] { return come_and_go(i); });
    }
    for (const pid_t child : children) {
        EXPECT_EQ(wait_for(child), 0);
    }
    EXPECT_FALSE(session.exists(RingKind::Contact));
}

}  // namespace
}  // namespace haptic
