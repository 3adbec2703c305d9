#include "view/page_replies.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "view/request_check.hpp"

namespace haptic::sim::view {
namespace {

bool has_header(lws* wsi, lws_token_indexes token) {
    return lws_hdr_total_length(wsi, token) > 0;
}

std::string local_host_name() {
    std::array<char, 256> name{};
    return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "localhost";
}

/// Whether a list in a header, separated by commas and with parameters after ';', has this element.
bool lists(std::string_view header, std::string_view wanted) {
    while (!header.empty()) {
        const std::size_t comma = std::min(header.find(','), header.size());
        std::string_view element = header.substr(0, comma);
        header.remove_prefix(std::min(comma + 1, header.size()));
        // "gzip;q=0" refuses it.
        const std::size_t semicolon = std::min(element.find(';'), element.size());
        const std::string_view parameter = element.substr(semicolon);
        const bool refused = parameter.find("q=0") != std::string_view::npos &&
                             parameter.find_first_of("123456789") == std::string_view::npos;
        element = element.substr(0, semicolon);
        const std::size_t first = std::min(element.find_first_not_of(" \t"), element.size());
        const std::size_t last = element.find_last_not_of(" \t");
        if (last != std::string_view::npos && element.substr(first, last - first + 1) == wanted) {
            return !refused;
        }
    }
    return false;
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

PageReplies::PageReplies() : host_name_(local_host_name()) {}

bool PageReplies::reject_foreign(lws* wsi) const {
    const std::string host = request_header(wsi, WSI_TOKEN_HOST);
    if (!host_is_own(host, host_name_)) {
        return refuse_request(
            wsi, HTTP_STATUS_BAD_REQUEST,
            "The Host header does not name this machine: use its IP address, its host name, or localhost.");
    }
    if (has_header(wsi, WSI_TOKEN_ORIGIN) && !origin_is_host(request_header(wsi, WSI_TOKEN_ORIGIN), host)) {
        return refuse_request(wsi, HTTP_STATUS_FORBIDDEN, "Pages of other sites may not access the live view.");
    }
    return false;
}

int PageReplies::start(lws* wsi, std::optional<Resource> resource) {
    if (reject_foreign(wsi)) {
        return -1;
    }
    // Only GET and HEAD of a known resource get further.
    const bool get = has_header(wsi, WSI_TOKEN_GET_URI);
    const bool head = has_header(wsi, WSI_TOKEN_HEAD_URI);
    if (!get && !head) {
        (void)refuse_request(wsi, HTTP_STATUS_METHOD_NOT_ALLOWED, "Only GET, HEAD and POST are supported.");
        return -1;
    }
    if (!resource) {
        (void)refuse_request(wsi, HTTP_STATUS_NOT_FOUND, "Not found.");
        return lws_http_transaction_completed(wsi) != 0 ? -1 : 0;
    }
    // Compose the response header in a buffer that starts with the library's own space.
    std::array<unsigned char, LWS_PRE + 2048> space{};
    unsigned char* const begin = space.data() + LWS_PRE;
    unsigned char* at = begin;
    unsigned char* const end = space.data() + space.size();
    const auto add = [&](const char* name, const std::string& value) {
        return lws_add_http_header_by_name(wsi, reinterpret_cast<const unsigned char*>(name),
                                           reinterpret_cast<const unsigned char*>(value.data()),
                                           static_cast<int>(value.size()), &at, end) == 0;
    };
    // Not every browser lets 'self' cover the WebSocket of the same host, so name it. The Host is known to be a plain
    // name.
    const std::string host = request_header(wsi, WSI_TOKEN_HOST);
    // A client that has this content is only told so; others get it compressed if they accept that. The tag is weak
    // (W/) because it names the content, not its compression.
    const std::string tag = resource->tag.empty() ? "" : "W/\"" + resource->tag + '"';
    const bool known = !tag.empty() && lists(request_header(wsi, WSI_TOKEN_HTTP_IF_NONE_MATCH), tag);
    const bool compressed =
        !resource->gzip.empty() && lists(request_header(wsi, WSI_TOKEN_HTTP_ACCEPT_ENCODING), "gzip");
    if (compressed) {
        resource->content = resource->gzip;
    }
    const std::size_t length = known ? 0 : resource->content.size();
    const unsigned empty_status = known ? HTTP_STATUS_NOT_MODIFIED : HTTP_STATUS_NO_CONTENT;
    bool fits =
        (length == 0 ? lws_add_http_header_status(wsi, empty_status, &at, end)
                     : lws_add_http_common_headers(wsi, HTTP_STATUS_OK, resource->type.c_str(), length, &at, end)) == 0;
    fits = fits && (tag.empty() || add("etag:", tag));
    fits = fits && (resource->gzip.empty() || add("vary:", "accept-encoding"));
    fits = fits && (!compressed || known || add("content-encoding:", "gzip"));
    fits = fits && add("content-security-policy:", "default-src 'self'; connect-src 'self' ws://" + host + " wss://" +
                                                       host + "; frame-ancestors 'none'; base-uri 'none'");
    // Offer a download as a file instead of showing it.
    if (!resource->download_as.empty()) {
        fits = fits && add("content-disposition:", "attachment; filename=\"" + resource->download_as + "\"");
    }
    if (!fits || lws_finalize_write_http_header(wsi, begin, &at, end) != 0) {
        return -1;
    }
    // HEAD, and an empty resource, end with the header; anything else is sent in chunks.
    if (head || length == 0) {
        return lws_http_transaction_completed(wsi) != 0 ? -1 : 0;
    }
    replies_[wsi] = {std::move(*resource), 0};
    (void)lws_callback_on_writable(wsi);
    return 0;
}

int PageReplies::answer(lws* wsi, unsigned status, const std::string& text) {
    std::array<unsigned char, LWS_PRE + 1024> space{};
    unsigned char* const begin = space.data() + LWS_PRE;
    unsigned char* at = begin;
    unsigned char* const end = space.data() + space.size();
    if (lws_add_http_common_headers(wsi, status, "text/plain; charset=utf-8", text.size(), &at, end) != 0 ||
        lws_finalize_write_http_header(wsi, begin, &at, end) != 0) {
        return -1;
    }
    const auto owner = std::make_shared<const std::string>(text);
    replies_[wsi] = {
        Resource{.type = {}, .content = std::as_bytes(std::span(*owner)), .owner = owner, .download_as = {}}, 0};
    (void)lws_callback_on_writable(wsi);
    return 0;
}

int PageReplies::resume(lws* wsi) {
    const auto found = replies_.find(wsi);
    if (found == replies_.end()) {
        return 0;
    }
    // Copy the next chunk behind the space that the library needs for its header.
    Reply& reply = found->second;
    const std::span<const std::byte> rest = reply.resource.content.subspan(reply.sent);
    const std::size_t length = std::min(rest.size(), kBytesPerWrite);
    std::vector<unsigned char> chunk(LWS_PRE + length);
    std::memcpy(chunk.data() + LWS_PRE, rest.data(), length);
    const bool last = length == rest.size();
    const int written = lws_write(wsi, chunk.data() + LWS_PRE, length, last ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP);
    if (written < static_cast<int>(length)) {
        return -1;
    }
    // Progress restarts the timeout.
    lws_set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, kRequestTimeoutS);
    reply.sent += length;
    if (last) {
        replies_.erase(found);
        return lws_http_transaction_completed(wsi) != 0 ? -1 : 0;
    }
    (void)lws_callback_on_writable(wsi);
    return 0;
}

}  // namespace haptic::sim::view
