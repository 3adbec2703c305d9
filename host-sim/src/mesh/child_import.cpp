// The child process: what it may have, and how its result comes back, through a pipe.
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>
#include <type_traits>

#include "mesh/mesh_import.hpp"

namespace haptic::sim::detail {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif
#else
constexpr bool kSanitized = false;
#endif

constexpr std::size_t kMostText = 1U << 16U;  // bytes, of a message or of all warnings

/// What the child says first.
struct Header {
    std::uint64_t magic;
    std::uint64_t vertices;   // then as many Vec3
    std::uint64_t triangles;  // then as many Triangle
    std::uint64_t text;       // then as many bytes: warnings, a line each, or what was thrown
    std::uint64_t threw;      // 1: there is nothing but the text
};
constexpr std::uint64_t kMagic = 0x6873'656d'2d70'6168U;
static_assert(std::is_trivially_copyable_v<Vec3> && sizeof(Vec3) == 3 * sizeof(double));

/// A file descriptor that closes itself.
class Descriptor {
  public:
    explicit Descriptor(int descriptor) : descriptor_(descriptor) {}
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    ~Descriptor() { close(); }
    void close() {
        if (descriptor_ >= 0) {
            (void)::close(descriptor_);
            descriptor_ = -1;
        }
    }
    [[nodiscard]] int get() const { return descriptor_; }

  private:
    int descriptor_;
};

void write_all(int to, const void* data, std::size_t bytes) {
    const auto* from = static_cast<const char*>(data);
    while (bytes > 0) {
        const ssize_t written = ::write(to, from, bytes);
        if (written < 0 && errno == EINTR) {
            continue;
        }
        if (written <= 0) {
            ::_exit(1);  // the parent has gone
        }
        from += written;
        bytes -= static_cast<std::size_t>(written);
    }
}

/// False where the other end was closed before.
bool read_all(int from, void* data, std::size_t bytes) {
    auto* to = static_cast<char*>(data);
    while (bytes > 0) {
        const ssize_t got = ::read(from, to, bytes);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got <= 0) {
            return false;
        }
        to += got;
        bytes -= static_cast<std::size_t>(got);
    }
    return true;
}

void limit(decltype(RLIMIT_AS) resource, rlim_t most) {
    rlimit limits{};
    if (::getrlimit(resource, &limits) == 0) {
        limits.rlim_cur = std::min(limits.rlim_cur, most);
        (void)::setrlimit(resource, &limits);
    }
}

/// The life of the child.
[[noreturn]] void live(const std::function<ImportedMesh()>& work, int to, const ChildLimits& limits) {
    // A crash is the parent's news, not that of a handler which this process may have, and leaves no core behind.
    for (const int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGXCPU, SIGPIPE}) {
        if (!kSanitized || signal == SIGXCPU || signal == SIGPIPE) {
            (void)std::signal(signal, SIG_DFL);
        }
    }
    if (const int nowhere = kSanitized ? -1 : ::open("/dev/null", O_WRONLY | O_CLOEXEC); nowhere >= 0) {
        (void)::dup2(nowhere, STDERR_FILENO);  // assimp's assertions are of no use to a user
    }
    limit(RLIMIT_CORE, 0);
    limit(RLIMIT_CPU, limits.cpu_s);
    if (!kSanitized) {
        limit(RLIMIT_AS, limits.memory_bytes);
    }
    ImportedMesh mesh;
    std::string text;
    Header header{kMagic, 0, 0, 0, 0};
    try {
        mesh = work();
        for (const std::string& warning : mesh.warnings) {
            text += warning + "\n";
        }
    } catch (const std::bad_alloc&) {
        header.threw = 1;
        text = "takes more than " + std::to_string(limits.memory_bytes >> 20U) + " MiB of memory";
    } catch (const std::exception& error) {
        header.threw = 1;
        text = error.what();
    } catch (...) {
        header.threw = 1;
        text = "assimp threw something unknown";
    }
    text.resize(std::min(text.size(), kMostText));
    header.text = text.size();
    if (header.threw == 0) {
        header.vertices = mesh.vertices.size();
        header.triangles = mesh.triangles.size();
    }
    write_all(to, &header, sizeof header);
    write_all(to, text.data(), text.size());
    write_all(to, mesh.vertices.data(), header.vertices * sizeof(Vec3));
    write_all(to, mesh.triangles.data(), header.triangles * sizeof(Triangle));
    ::_exit(0);  // nothing of the parent's is destroyed or flushed twice
}

/// What the child says, believed no more than its limits allow. False where it said less than it announced.
bool listen(int from, const ImportRequest& request, ImportedMesh& mesh, std::string& thrown) {
    Header header{};
    if (!read_all(from, &header, sizeof header) || header.magic != kMagic || header.text > kMostText ||
        header.vertices > request.most_vertices || header.triangles > request.most_triangles) {
        return false;
    }
    std::string text(header.text, '\0');
    if (!read_all(from, text.data(), text.size())) {
        return false;
    }
    if (header.threw != 0) {
        thrown = text.empty() ? "assimp says nothing" : text;
        return true;
    }
    mesh.vertices.resize(header.vertices);
    mesh.triangles.resize(header.triangles);
    if (!read_all(from, mesh.vertices.data(), header.vertices * sizeof(Vec3)) ||
        !read_all(from, mesh.triangles.data(), header.triangles * sizeof(Triangle))) {
        return false;
    }
    for (std::size_t start = 0; start < text.size();) {
        const std::size_t end = std::min(text.find('\n', start), text.size());
        mesh.warnings.push_back(text.substr(start, end - start));
        start = end + 1;
    }
    return true;
}

/// Waits for the child's end; how it died, or nothing where it ended by itself.
std::string bury(pid_t child, const ChildLimits& limits) {
    int status = 0;
    while (::waitpid(child, &status, 0) < 0) {
        if (errno != EINTR) {
            return {};  // somebody else has waited for it; what it said counts
        }
    }
    if (WIFSIGNALED(status)) {
        const int signal = WTERMSIG(status);
        if (signal == SIGXCPU || signal == SIGKILL) {
            return "was given up after " + std::to_string(limits.cpu_s) + " s of computing, or for want of memory";
        }
        return "broke assimp (signal " + std::to_string(signal) +
               "): it is malformed in a way that assimp does not notice";
    }
    return WEXITSTATUS(status) == 0 ? std::string()
                                    : "broke assimp: it is malformed in a way that assimp does not notice";
}

}  // namespace

ImportedMesh in_child(const std::function<ImportedMesh()>& work, const ImportRequest& request,
                      const ChildLimits& limits) {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
        throw std::runtime_error("no pipe to a child process: " + std::system_category().message(errno));
    }
    Descriptor from(ends[0]);
    Descriptor to(ends[1]);
    const pid_t child = ::fork();
    if (child < 0) {
        throw std::runtime_error("no child process to read it in: " + std::system_category().message(errno));
    }
    if (child == 0) {
        live(work, to.get(), limits);
    }
    to.close();
    ImportedMesh mesh;
    std::string thrown;
    bool whole = false;
    try {
        whole = listen(from.get(), request, mesh, thrown);
    } catch (...) {
        from.close();
        (void)bury(child, limits);
        throw;
    }
    from.close();  // a child that still writes ends by it
    const std::string death = bury(child, limits);
    if (!death.empty()) {
        throw std::runtime_error(death);
    }
    if (!whole) {
        throw std::runtime_error("broke assimp: what came back is not what was announced");
    }
    if (!thrown.empty()) {
        throw std::runtime_error(thrown);
    }
    return mesh;
}

}  // namespace haptic::sim::detail
