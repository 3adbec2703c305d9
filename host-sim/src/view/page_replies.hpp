// Answers to HTTP requests: pages and files, in as many pieces as the socket takes, and refusals. For libwebsockets, on
// the thread of its event loop; what returns an int returns what a callback of the library is to return.
#pragma once

#include <libwebsockets.h>

#include <cstddef>
#include <map>
#include <optional>
#include <string>

#include "view/web_server.hpp"

namespace haptic::sim::view {

inline constexpr int kRequestPatienceS = 10;  // with one that does not come to its end

/// A header of a request; empty if it is not there, or longer than any that is good.
[[nodiscard]] std::string request_header(lws* wsi, lws_token_indexes token);

/// Answers with an error. Always true: it is the answer.
bool refuse_request(lws* wsi, unsigned status, const char* why);

class PageReplies {
  public:
    PageReplies();

    /// Answers those who ask for another machine, or from the page of another site; true if this was one.
    [[nodiscard]] bool refuse_stranger(lws* wsi) const;

    /// Answers a request for a resource; none: there is nothing at that path.
    int begin(lws* wsi, std::optional<Resource> resource);
    /// The socket takes more.
    int go_on(lws* wsi);
    /// The connection is no more.
    void forget(lws* wsi) { replies_.erase(wsi); }

  private:
    struct Reply {
        Resource resource;
        std::size_t sent = 0;
    };

    std::string machine_;  // its host name
    std::map<const lws*, Reply> replies_;
};

}  // namespace haptic::sim::view
