#include "haptic/edge_capture.hpp"

#include <array>
#include <exception>
#include <system_error>
#include <utility>

namespace haptic {
namespace {

constexpr std::int64_t kWaitNs = 20'000'000;     // interval at which the thread checks whether to end
constexpr std::int64_t kSettleNs = 200'000'000;  // without an edge: what passes the line's edges on may be slow
constexpr std::size_t kStackBytes = std::size_t{1} << 18;  // small, because mlockall locks all of it
constexpr std::size_t kBatch = 64;

}  // namespace

EdgeCapture::EdgeCapture(std::unique_ptr<EdgeSource> line, Take take, std::function<void()> prepare)
    : line_(std::move(line)), take_(std::move(take)), prepare_(std::move(prepare)) {
    pthread_attr_t attributes;
    int error = pthread_attr_init(&attributes);
    if (error == 0) {
        error = pthread_attr_setstacksize(&attributes, kStackBytes);
        error = error == 0 ? pthread_create(&thread_, &attributes, &EdgeCapture::thread_entry, this) : error;
        pthread_attr_destroy(&attributes);
    }
    if (error != 0) {
        throw std::system_error(error, std::system_category(), "creating the thread that captures edges");
    }
}

EdgeCapture::~EdgeCapture() {
    stop();
}

void EdgeCapture::stop() {
    if (joined_) {
        return;
    }
    ending_.store(true);
    pthread_join(thread_, nullptr);
    joined_ = true;
}

void* EdgeCapture::thread_entry(void* self) {
    auto* const capture = static_cast<EdgeCapture*>(self);
    if (capture->prepare_) {
        capture->prepare_();
    }
    try {
        capture->capture();
    } catch (const std::exception& error) {
        capture->problem_ = error.what();
    }
    return nullptr;
}

void EdgeCapture::capture() {
    std::array<Edge, kBatch> batch{};
    while (!ending_.load()) {
        take_(std::span(batch).first(line_->read(batch, kWaitNs)));
    }
    // Read the edges that the kernel still holds, and those that are on their way.
    for (std::size_t count = kBatch; count > 0;) {
        count = line_->read(batch, kSettleNs);
        take_(std::span(batch).first(count));
    }
}

}  // namespace haptic
