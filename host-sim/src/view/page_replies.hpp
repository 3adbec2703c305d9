// HTTP replies: pages and files, in chunks as the socket takes them, and error replies. For libwebsockets, on the
// thread of its event loop; a function that returns int returns the result of a libwebsockets callback.
#pragma once

#include <libwebsockets.h>

#include <cstddef>
#include <map>
#include <optional>
#include <string>

#include "view/web_server.hpp"

namespace haptic::sim::view {

inline constexpr int kRequestTimeoutS = 10;  // for a request that never completes
inline constexpr std::size_t kBytesPerWrite = 65536;

/// A header of a request; empty if it is missing or longer than 511 bytes.
[[nodiscard]] std::string request_header(lws* wsi, lws_token_indexes token);

/// Replies with an error. Always returns true, so that a caller can return it as "answered".
bool refuse_request(lws* wsi, unsigned status, const char* why);

class PageReplies {
  public:
    PageReplies();

    /// Rejects a request whose Host is not this machine or whose Origin is another site; returns true if it did.
    [[nodiscard]] bool reject_foreign(lws* wsi) const;

    /// Starts the reply to a request for a resource; without one it replies 404.
    int start(lws* wsi, std::optional<Resource> resource);
    /// Starts a reply of plain text. To be called when the socket is writable.
    int answer(lws* wsi, unsigned status, const std::string& text);
    /// Writes the next chunk when the socket is writable.
    int resume(lws* wsi);
    /// The connection has been closed.
    void forget(lws* wsi) { replies_.erase(wsi); }

  private:
    struct Reply {
        Resource resource;
        std::size_t sent = 0;
    };

    std::string host_name_;
    std::map<const lws*, Reply> replies_;
};

}  // namespace haptic::sim::view
