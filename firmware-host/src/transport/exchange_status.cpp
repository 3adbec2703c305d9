#include "haptic/device/exchange_status.hpp"

namespace haptic::device {

std::string_view describe(ExchangeStatus status) noexcept {
    switch (status) {
        case ExchangeStatus::Ok:
            return "answered";
        case ExchangeStatus::Timeout:
            return "no reply in time";
        case ExchangeStatus::Short:
            return "a reply of the wrong length";
        case ExchangeStatus::Malformed:
            return "a malformed reply";
        case ExchangeStatus::Stale:
            return "a reply to an earlier command";
        case ExchangeStatus::Stalled:
            return "the endpoint stalled";
        case ExchangeStatus::Disconnected:
            return "disconnected";
        case ExchangeStatus::Failed:
            return "a transfer failed on the bus";
    }
    return "unknown status";
}

}  // namespace haptic::device
