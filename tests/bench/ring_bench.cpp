// Cost of the ring: a publication, a reading, and the transfer of a frame to another process on the next core.
//
// The counters p50_us and p99_us are of the single latencies, each taken with both clocks read on its own core. Both
// include one reading of the clock, about 0.03 us.
#include <benchmark/benchmark.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>

#include "haptic/clock.hpp"
#include "haptic/histogram.hpp"
#include "haptic/ring.hpp"

namespace haptic {
namespace {

std::string session_name() {
    return "bench-" + std::to_string(getpid());
}

std::unique_ptr<ContactFrame> frame_with(std::int64_t proxies) {
    auto frame = std::make_unique<ContactFrame>();
    frame->proxy_count = static_cast<std::uint32_t>(proxies);
    return frame;
}

void publish_contact_frame(benchmark::State& state) {
    RingWriter<ContactFrame> writer(session_name());
    const auto frame = frame_with(state.range(0));
    std::int64_t now_ns = 0;
    for ([[maybe_unused]] auto _ : state) {
        benchmark::DoNotOptimize(writer.publish(*frame, ++now_ns));
    }
    state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(detail::used_bytes(*frame)));
}
BENCHMARK(publish_contact_frame)->ArgName("proxies")->Arg(1)->Arg(37)->Arg(64);

void publish_and_read_device_state_in_one_process(benchmark::State& state) {
    RingWriter<DeviceState> writer(session_name());
    RingReader<DeviceState> reader(session_name());
    DeviceState sent{};
    DeviceState received{};
    for ([[maybe_unused]] auto _ : state) {
        writer.publish(sent, 1);
        benchmark::DoNotOptimize(reader.read_newest(received));
    }
}
BENCHMARK(publish_and_read_device_state_in_one_process);

void read_when_there_is_nothing_new(benchmark::State& state) {
    RingReader<ContactFrame> reader(session_name());
    const auto frame = frame_with(64);
    for ([[maybe_unused]] auto _ : state) {
        benchmark::DoNotOptimize(reader.read_newest(*frame));
    }
}
BENCHMARK(read_when_there_is_nothing_new);

/// Runs on one core while it lives.
class PinnedTo {
  public:
    explicit PinnedTo(int core) {
        sched_getaffinity(0, sizeof before_, &before_);
        cpu_set_t one;
        CPU_ZERO(&one);
        CPU_SET(static_cast<std::size_t>(core), &one);
        sched_setaffinity(0, sizeof one, &one);
    }
    PinnedTo(const PinnedTo&) = delete;
    PinnedTo& operator=(const PinnedTo&) = delete;
    ~PinnedTo() { sched_setaffinity(0, sizeof before_, &before_); }

  private:
    cpu_set_t before_{};
};

/// When the reading process had the frame. On a line of its own.
struct alignas(64) Receipt {
    std::atomic<std::uint64_t> sequence{0};
    std::atomic<std::int64_t> time_ns{0};
    std::atomic<bool> stop{false};
};

/// Memory that this process and its children share.
void* shared_memory(std::size_t bytes) {
    void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) {
        throw std::runtime_error("no memory to share");
    }
    return memory;
}

/// A process on another core that spins on the ring and notes when it has each frame.
class SpinningReader {
  public:
    /// `whole`: when the frame was copied; otherwise when its publication was seen.
    SpinningReader(int core, bool whole) {
        receipt_ = new (shared_memory(sizeof(Receipt))) Receipt;
        child_ = fork();
        if (child_ == 0) {
            spin(core, whole);
            _exit(0);
        }
    }
    SpinningReader(const SpinningReader&) = delete;
    SpinningReader& operator=(const SpinningReader&) = delete;
    ~SpinningReader() {
        receipt_->stop.store(true);
        waitpid(child_, nullptr, 0);
        munmap(receipt_, sizeof(Receipt));
    }

    /// The time at which it had the frame.
    [[nodiscard]] std::int64_t wait_for(std::uint64_t sequence) const {
        while (receipt_->sequence.load(std::memory_order_acquire) < sequence) {
        }
        return receipt_->time_ns.load(std::memory_order_acquire);
    }

  private:
    void spin(int core, bool whole) const {
        const PinnedTo pinned(core);
        RingReader<ContactFrame> reader(session_name_);
        const auto frame = frame_with(0);
        std::int64_t last_heartbeat = 0;
        while (!receipt_->stop.load(std::memory_order_relaxed)) {
            if (whole) {
                if (reader.read_newest(*frame)) {
                    note(frame->sequence);
                }
            } else if (const std::int64_t heartbeat = reader.peer().heartbeat_ns; heartbeat != last_heartbeat) {
                last_heartbeat = heartbeat;
                note(static_cast<std::uint64_t>(heartbeat));
            }
        }
    }
    void note(std::uint64_t sequence) const {
        receipt_->time_ns.store(monotonic_now_ns(), std::memory_order_release);
        receipt_->sequence.store(sequence, std::memory_order_release);
    }

    std::string session_name_ = session_name();
    Receipt* receipt_ = nullptr;
    pid_t child_ = -1;
};

/// From the return of publish() in one process to the frame in the hands of the other; or, from its beginning.
void pass_between_processes(benchmark::State& state, bool whole, bool from_beginning) {
    if (sysconf(_SC_NPROCESSORS_ONLN) < 2) {
        state.SkipWithError("needs two cores");
        return;
    }
    const PinnedTo pinned(0);
    const SpinningReader reader(1, whole);
    RingWriter<ContactFrame> writer(session_name());
    const auto frame = frame_with(state.range(0));
    Histogram latencies;
    std::int64_t published = 0;
    for ([[maybe_unused]] auto _ : state) {
        const std::int64_t begin_ns = monotonic_now_ns();
        const std::uint64_t sequence = writer.publish(*frame, ++published);
        const std::int64_t end_ns = monotonic_now_ns();
        const std::int64_t latency_ns = reader.wait_for(sequence) - (from_beginning ? begin_ns : end_ns);
        latencies.record(latency_ns);
        state.SetIterationTime(seconds(std::max<std::int64_t>(0, latency_ns)));
    }
    state.counters["p50_us"] = static_cast<double>(latencies.percentile_ns(0.5)) * 1e-3;
    state.counters["p99_us"] = static_cast<double>(latencies.percentile_ns(0.99)) * 1e-3;
}
BENCHMARK_CAPTURE(pass_between_processes, from_publish_begin_to_frame_copied, true, true)
    ->ArgName("proxies")
    ->Arg(1)
    ->Arg(37)
    ->Arg(64)
    ->UseManualTime()
    ->Iterations(100'000);
BENCHMARK_CAPTURE(pass_between_processes, from_publish_end_to_frame_copied, true, false)
    ->ArgName("proxies")
    ->Arg(1)
    ->Arg(37)
    ->Arg(64)
    ->UseManualTime()
    ->Iterations(100'000);
BENCHMARK_CAPTURE(pass_between_processes, from_publish_end_to_seen, false, false)
    ->ArgName("proxies")
    ->Arg(64)
    ->UseManualTime()
    ->Iterations(100'000);

}  // namespace
}  // namespace haptic

BENCHMARK_MAIN();
