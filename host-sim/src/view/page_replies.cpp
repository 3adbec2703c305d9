#include "view/page_replies.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "view/request_check.hpp"

namespace haptic::sim::view {
namespace {

constexpr std::size_t kPiece = 65536;  // bytes that are written at once

bool has_header(lws* wsi, lws_token_indexes token) {
    return lws_hdr_total_length(wsi, token) > 0;
}

std::string machine_name() {
    std::array<char, 256> name{};
    return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "localhost";
}

}  // namespace

std::string request_header(lws* wsi, lws_token_indexes token) {
    std::array<char, 512> text{};
    const int length = lws_hdr_copy(wsi, text.data(), static_cast<int>(text.size()), token);
    return length > 0 ? std::string(text.data(), static_cast<std::size_t>(length)) : std::string();
}

bool refuse_request(lws* wsi, unsigned status, const char* why) {
    (void)lws_return_http_status(wsi, status, why);
    return true;
}

PageReplies::PageReplies() : machine_(machine_name()) {}

bool PageReplies::refuse_stranger(lws* wsi) const {
    const std::string host = request_header(wsi, WSI_TOKEN_HOST);
    if (!host_is_own(host, machine_)) {
        return refuse_request(
            wsi, HTTP_STATUS_BAD_REQUEST,
            "This is no name of this machine: ask for it by its address, its host name, or as localhost.");
    }
    if (has_header(wsi, WSI_TOKEN_ORIGIN) && !origin_is_host(request_header(wsi, WSI_TOKEN_ORIGIN), host)) {
        return refuse_request(wsi, HTTP_STATUS_FORBIDDEN, "A page of another site may not look.");
    }
    return false;
}

int PageReplies::begin(lws* wsi, std::optional<Resource> resource) {
    if (refuse_stranger(wsi)) {
        return -1;
    }
    const bool get = has_header(wsi, WSI_TOKEN_GET_URI);
    const bool head = has_header(wsi, WSI_TOKEN_HEAD_URI);
    if (!get && !head) {
        (void)refuse_request(wsi, HTTP_STATUS_METHOD_NOT_ALLOWED, "GET and HEAD are all that can be done here.");
        return -1;
    }
    if (!resource) {
        (void)refuse_request(wsi, HTTP_STATUS_NOT_FOUND, "There is nothing here.");
        return lws_http_transaction_completed(wsi) != 0 ? -1 : 0;
    }
    std::array<unsigned char, LWS_PRE + 2048> space{};
    unsigned char* const begin = space.data() + LWS_PRE;
    unsigned char* at = begin;
    unsigned char* const end = space.data() + space.size();
    const auto add = [&](const char* name, const std::string& value) {
        return lws_add_http_header_by_name(wsi, reinterpret_cast<const unsigned char*>(name),
                                           reinterpret_cast<const unsigned char*>(value.data()),
                                           static_cast<int>(value.size()), &at, end) == 0;
    };
    // Not every browser takes 'self' to mean the WebSocket of the same host. The Host is known to be a plain name.
    const std::string host = request_header(wsi, WSI_TOKEN_HOST);
    const std::size_t length = resource->content.size();
    bool good =
        (length == 0 ? lws_add_http_header_status(wsi, HTTP_STATUS_NO_CONTENT, &at, end)
                     : lws_add_http_common_headers(wsi, HTTP_STATUS_OK, resource->type.c_str(), length, &at, end)) == 0;
    good = good && add("content-security-policy:", "default-src 'self'; connect-src 'self' ws://" + host + " wss://" +
                                                       host + "; frame-ancestors 'none'; base-uri 'none'");
    if (!resource->download_as.empty()) {
        good = good && add("content-disposition:", "attachment; filename=\"" + resource->download_as + "\"");
    }
    if (!good || lws_finalize_write_http_header(wsi, begin, &at, end) != 0) {
        return -1;
    }
    if (head || length == 0) {
        return lws_http_transaction_completed(wsi) != 0 ? -1 : 0;
    }
    replies_[wsi] = {std::move(*resource), 0};
    (void)lws_callback_on_writable(wsi);
    return 0;
}

int PageReplies::go_on(lws* wsi) {
    const auto found = replies_.find(wsi);
    if (found == replies_.end()) {
        return 0;
    }
    Reply& reply = found->second;
    const std::span<const std::byte> rest = reply.resource.content.subspan(reply.sent);
    const std::size_t length = std::min(rest.size(), kPiece);
    std::vector<unsigned char> chunk(LWS_PRE + length);
    std::memcpy(chunk.data() + LWS_PRE, rest.data(), length);
    const bool last = length == rest.size();
    const int written = lws_write(wsi, chunk.data() + LWS_PRE, length, last ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP);
    if (written < static_cast<int>(length)) {
        return -1;
    }
    lws_set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, kRequestPatienceS);
    reply.sent += length;
    if (last) {
        replies_.erase(found);
        return lws_http_transaction_completed(wsi) != 0 ? -1 : 0;
    }
    (void)lws_callback_on_writable(wsi);
    return 0;
}

}  // namespace haptic::sim::view
