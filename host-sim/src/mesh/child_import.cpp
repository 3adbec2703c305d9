// Child process of the mesh import: its resource limits, and the transfer of its result through a pipe.
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

constexpr std::size_t kMaxText = 1U << 16U;  // bytes, of an error message or of all warnings

/// First record that the child writes.
struct Header {
    std::uint64_t magic;
    std::uint64_t vertices;   // followed by this many Vec3
    std::uint64_t triangles;  // followed by this many Triangle
    std::uint64_t text;       // followed by this many bytes: one warning a line, or the exception's message
    std::uint64_t threw;      // 1: only the text follows
};
constexpr std::uint64_t kMagic = 0x6873'656d'2d70'6168U;
static_assert(std::is_trivially_copyable_v<Vec3> && sizeof(Vec3) == 3 * sizeof(double));

/// Owns a file descriptor.
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
            ::_exit(0);  // the parent has closed its end, and knows why
        }
        from += written;
        bytes -= static_cast<std::size_t>(written);
    }
}

/// False if the other end was closed too early.
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

void limit(decltype(RLIMIT_AS) resource, rlim_t max) {
    rlimit limits{};
    if (::getrlimit(resource, &limits) == 0) {
        limits.rlim_cur = std::min(limits.rlim_cur, max);
        (void)::setrlimit(resource, &limits);
    }
}

/// Body of the child process.
[[noreturn]] void run_child(const std::function<ImportedMesh()>& work, int to, const ChildLimits& limits) {
    // The parent reports a crash: remove inherited handlers, and write no core file.
    for (const int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGXCPU, SIGPIPE}) {
        if (!kSanitized || signal == SIGXCPU || signal == SIGPIPE) {
            (void)std::signal(signal, SIG_DFL);
        }
    }
    // The caller's thread may block all signals, and that of the CPU time ends the child.
    sigset_t none{};
    (void)::sigemptyset(&none);
    (void)::sigprocmask(SIG_SETMASK, &none, nullptr);
    if (const int null_device = kSanitized ? -1 : ::open("/dev/null", O_WRONLY | O_CLOEXEC); null_device >= 0) {
        (void)::dup2(null_device, STDERR_FILENO);  // hides assimp's assertion messages
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
        text = "needs more than " + std::to_string(limits.memory_bytes >> 20U) + " MiB of memory";
    } catch (const std::exception& error) {
        header.threw = 1;
        text = error.what();
    } catch (...) {
        header.threw = 1;
        text = "assimp threw an unknown exception";
    }
    text.resize(std::min(text.size(), kMaxText));
    header.text = text.size();
    if (header.threw == 0) {
        header.vertices = mesh.vertices.size();
        header.triangles = mesh.triangles.size();
    }
    write_all(to, &header, sizeof header);
    write_all(to, text.data(), text.size());
    write_all(to, mesh.vertices.data(), header.vertices * sizeof(Vec3));
    write_all(to, mesh.triangles.data(), header.triangles * sizeof(Triangle));
    ::_exit(0);  // without destructors and flushing, which belong to the parent
}

/// Receives the child's result, within the limits of the request. False if less arrives than announced.
bool receive(int from, const ImportRequest& request, ImportedMesh& mesh, std::string& thrown) {
    Header header{};
    if (!read_all(from, &header, sizeof header) || header.magic != kMagic || header.text > kMaxText ||
        header.vertices > request.max_vertices || header.triangles > request.max_triangles) {
        return false;
    }
    std::string text(header.text, '\0');
    if (!read_all(from, text.data(), text.size())) {
        return false;
    }
    if (header.threw != 0) {
        thrown = text.empty() ? "assimp gives no reason" : text;
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

/// Waits for the child. Returns a description of how it died, or nothing if it exited normally.
std::string wait_for(pid_t child, const ChildLimits& limits) {
    int status = 0;
    while (::waitpid(child, &status, 0) < 0) {
        if (errno != EINTR) {
            return {};  // already reaped elsewhere: rely on its result
        }
    }
    if (WIFSIGNALED(status)) {
        const int signal = WTERMSIG(status);
        if (signal == SIGPIPE) {
            return {};  // the parent has closed its end
        }
        if (signal == SIGXCPU || signal == SIGKILL) {
            return "was given up after " + std::to_string(limits.cpu_s) + " s of CPU time, or for lack of memory";
        }
        return "broke assimp (signal " + std::to_string(signal) +
               "): the file is malformed in a way that assimp does not detect";
    }
    return WEXITSTATUS(status) == 0 ? std::string()
                                    : "broke assimp: the file is malformed in a way that assimp does not detect";
}

}  // namespace

ImportedMesh in_child(const std::function<ImportedMesh()>& work, const ImportRequest& request,
                      const ChildLimits& limits) {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
        throw std::runtime_error("cannot create a pipe to a child process: " + std::system_category().message(errno));
    }
    Descriptor from(ends[0]);
    Descriptor to(ends[1]);
    const pid_t child = ::fork();
    if (child < 0) {
        throw std::runtime_error("cannot create a child process: " + std::system_category().message(errno));
    }
    if (child == 0) {
        from.close();  // or it would wait for ever for a parent that has been killed to read
        run_child(work, to.get(), limits);
    }
    to.close();
    ImportedMesh mesh;
    std::string thrown;
    bool complete = false;
    try {
        complete = receive(from.get(), request, mesh, thrown);
    } catch (...) {
        from.close();
        (void)wait_for(child, limits);
        throw;
    }
    from.close();  // ends a child that is still writing
    const std::string death = wait_for(child, limits);
    if (!death.empty()) {
        throw std::runtime_error(death);
    }
    if (!complete) {
        throw std::runtime_error("broke assimp: the result is not what was announced");
    }
    if (!thrown.empty()) {
        throw std::runtime_error(thrown);
    }
    return mesh;
}

}  // namespace haptic::sim::detail
