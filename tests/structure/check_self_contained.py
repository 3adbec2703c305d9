#!/usr/bin/env python3
"""Checks that each source and header includes what it uses, itself or by way of the project's headers.

Usage: check_self_contained.py ROOT [FOLDER ...]

Release and check builds join sources and precompile headers, so a forgotten include goes unnoticed there and fails in a plain build. This
check reads text and compiles nothing. For each file of {shared,firmware-host,rt-core,host-sim}/{src,include} it follows the includes to
other files of the project and collects the system headers that any of them includes. Then it requires, anywhere among these,

 - a header that provides each name of the standard library, of POSIX, GLM and other libraries that the tables list;
 - a header that defines each type, constant, function and HAPTIC_ macro that the project defines in headers only, unless a file among
   those read declares the name otherwise: as a member, a parameter, a local name. A forward declaration is enough for a type, but not for
   Type::, Type{ and access to the members of a variable of this type.

It knows neither scopes nor overloads, nor the types of expressions, and takes both sides of an #if. So it misses some mistakes, such as
the header of a type that only a call returns, but should accept every correct file. Where a table lists several headers for a name, each
of them is accepted and the first is proposed. A name that no table lists is not checked: add it where a plain build failed.
"""
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path

# Folder -> where its includes are looked up, as its CMakeLists.txt does.
SHARED = ["shared/src", "shared/include"]
INCLUDE_DIRECTORIES = {
    "shared": SHARED,
    "firmware-host": ["firmware-host/src", "firmware-host/include", *SHARED],
    "rt-core": ["rt-core/src", "rt-core/include", "firmware-host/include", *SHARED],
    "host-sim": ["host-sim/src", "host-sim/include", *SHARED],
}

CONTAINERS = "array vector string string_view span deque list map set unordered_map unordered_set initializer_list iterator"
# Headers -> the names in std:: and std::ranges:: that each of these headers provides; std::filesystem::path counts as std::filesystem.
STANDARD = {
    "vector": "vector",
    "array": "array to_array",
    "span": "span as_bytes as_writable_bytes dynamic_extent",
    "optional": "optional nullopt",
    "string": "string wstring to_string stoi stol stoll stoul stoull stod stof",
    "string_view": "string_view wstring_view",
    "map": "map multimap",
    "set": "set multiset",
    "deque": "deque",
    "list": "list",
    "queue": "queue priority_queue",
    "stack": "stack",
    "unordered_map": "unordered_map unordered_multimap",
    "unordered_set": "unordered_set",
    "bitset": "bitset",
    "any": "any",
    "variant": "variant visit get_if holds_alternative monostate variant_size_v variant_alternative_t bad_variant_access",
    "tuple": "tuple tie make_tuple apply forward_as_tuple tuple_cat",
    "tuple array utility": "tuple_size tuple_size_v tuple_element tuple_element_t",
    "memory":
        "unique_ptr shared_ptr weak_ptr make_unique make_unique_for_overwrite make_shared enable_shared_from_this allocator addressof "
        "construct_at destroy_at default_delete static_pointer_cast assume_aligned to_address uninitialized_fill_n",
    "functional": "function invoke bind_front reference_wrapper ref cref not_fn multiplies negate bit_or",
    "functional map set queue memory": "greater less plus minus hash equal_to",
    "utility":
        "exchange as_const declval index_sequence make_index_sequence index_sequence_for integer_sequence in_place cmp_less "
        "piecewise_construct cmp_equal in_range unreachable",
    f"utility memory tuple optional variant functional {CONTAINERS} algorithm": "pair make_pair move forward swap",
    "atomic":
        "atomic atomic_ref atomic_flag atomic_thread_fence atomic_signal_fence memory_order memory_order_relaxed memory_order_acquire "
        "memory_order_release memory_order_acq_rel memory_order_seq_cst",
    "mutex": "mutex recursive_mutex lock_guard scoped_lock once_flag call_once",
    "mutex shared_mutex condition_variable": "unique_lock",
    "shared_mutex": "shared_mutex shared_lock",
    "condition_variable": "condition_variable condition_variable_any cv_status",
    "thread": "thread jthread this_thread",
    "thread stop_token": "stop_token stop_source stop_callback",
    "future": "future promise async launch future_status packaged_task",
    "semaphore": "counting_semaphore binary_semaphore",
    "latch": "latch",
    "barrier": "barrier",
    "chrono": "chrono",
    "filesystem": "filesystem",
    "random": "mt19937 mt19937_64 uniform_real_distribution uniform_int_distribution normal_distribution random_device minstd_rand",
    "stdexcept":
        "runtime_error invalid_argument logic_error out_of_range domain_error length_error overflow_error range_error underflow_error",
    "exception":
        "exception_ptr current_exception rethrow_exception terminate uncaught_exceptions nested_exception make_exception_ptr "
        "throw_with_nested set_terminate",
    "exception stdexcept new system_error": "exception",
    "system_error": "system_error error_category generic_category system_category make_error_code make_error_condition",
    "system_error filesystem charconv": "error_code errc error_condition",
    "new": "align_val_t nothrow nothrow_t launder set_new_handler hardware_destructive_interference_size",
    "new memory": "bad_alloc",
    "limits": "numeric_limits",
    "numbers": "numbers",
    "complex": "complex",
    "ratio": "ratio",
    "bit": "bit_cast countr_zero countl_zero popcount bit_ceil bit_floor bit_width has_single_bit endian rotl rotr countr_one",
    "numeric":
        "accumulate iota partial_sum inner_product gcd lcm reduce transform_reduce exclusive_scan inclusive_scan adjacent_difference "
        "midpoint",
    "algorithm":
        "sort stable_sort partial_sort nth_element is_sorted is_sorted_until find find_if find_if_not find_first_of find_end any_of "
        "all_of none_of count count_if copy_if copy_n copy_backward transform generate generate_n replace replace_if fill_n remove_if "
        "remove_copy_if unique unique_copy reverse reverse_copy rotate shuffle sample partition stable_partition partition_copy "
        "partition_point lower_bound upper_bound equal_range binary_search merge inplace_merge includes set_union set_intersection "
        "set_difference push_heap pop_heap make_heap sort_heap min_element max_element minmax_element minmax clamp adjacent_find mismatch "
        "search search_n for_each for_each_n lexicographical_compare next_permutation is_permutation swap_ranges contains min max fill "
        "copy equal",
    "algorithm cstdio": "remove",
    "iterator": "istream_iterator ostream_iterator istreambuf_iterator ostreambuf_iterator",
    f"{CONTAINERS}":
        "back_inserter inserter front_inserter make_move_iterator next prev advance distance reverse_iterator move_iterator "
        "iterator_traits begin end cbegin cend rbegin rend size ssize data empty erase erase_if random_access_iterator_tag "
        "forward_iterator_tag input_iterator_tag",
    f"initializer_list {CONTAINERS} utility": "initializer_list",
    "type_traits":
        "is_trivially_copyable_v is_trivially_destructible_v is_standard_layout_v is_same_v is_signed_v is_unsigned_v is_floating_point_v "
        "is_arithmetic_v is_integral_v is_enum_v is_invocable_v is_invocable_r_v is_base_of_v is_convertible_v is_void_v is_const_v "
        "conditional_t enable_if_t decay_t remove_reference_t remove_cvref_t remove_const_t invoke_result_t underlying_type_t "
        "make_unsigned_t make_signed_t integral_constant bool_constant true_type false_type type_identity_t common_type_t void_t "
        "is_nothrow_move_constructible_v is_constructible_v add_const_t remove_extent_t is_constant_evaluated",
    "concepts":
        "integral floating_point same_as convertible_to invocable derived_from signed_integral unsigned_integral totally_ordered regular",
    "compare": "strong_ordering weak_ordering partial_ordering",
    "charconv": "from_chars to_chars from_chars_result to_chars_result chars_format",
    "sstream": "istringstream ostringstream stringstream stringbuf",
    "fstream": "ifstream ofstream fstream filebuf",
    "iostream": "cout cin cerr clog",
    "iomanip": "setw setprecision setfill quoted put_time get_time setbase",
    "ostream iostream sstream fstream iomanip": "flush endl",
    "iosfwd ostream istream iostream sstream fstream string iomanip": "ostream istream",
    "ios ostream istream iostream sstream fstream iomanip":
        "fixed scientific defaultfloat hex dec left right internal boolalpha ios ios_base streamsize noskipws streamoff streampos",
    "string sstream istream iostream fstream": "getline",
    "regex": "regex smatch regex_match regex_search",
    "typeindex": "type_index",
    "source_location": "source_location",
    "format": "format format_to",
    "locale": "locale",
    "cstdint":
        "int8_t int16_t int32_t int64_t uint8_t uint16_t uint32_t uint64_t uintptr_t intptr_t intmax_t uintmax_t int_fast8_t "
        "uint_least8_t",
    f"cstddef {CONTAINERS} span memory": "ptrdiff_t",
    "cstddef": "byte max_align_t to_integer nullptr_t",
    f"cstddef cstdio cstdlib cstring ctime {CONTAINERS} span memory bit bitset new tuple utility variant algorithm functional": "size_t",
    "cmath":
        "sqrt isfinite isnan isinf fabs floor ceil round lround llround sin cos tan asin acos atan atan2 exp exp2 expm1 log log2 log10 "
        "log1p pow hypot copysign cbrt fmod fma ldexp frexp nextafter trunc sinh cosh tanh signbit remainder rint lrint nearbyint modf "
        "ilogb scalbn fmin fmax erf tgamma lgamma lerp",
    "cmath cstdlib": "abs",
    "cstdlib":
        "getenv strtod strtol strtoll strtoul strtoull llabs labs atexit at_quick_exit quick_exit exit abort malloc free calloc realloc "
        "system atoi atof div rand srand _Exit aligned_alloc qsort",
    "cstring": "memcpy memmove memset memcmp memchr strlen strcmp strncmp strchr strrchr strstr strerror strncpy strcpy strtok strnlen",
    "cstdio":
        "printf fprintf snprintf vsnprintf vfprintf fputs puts putchar fputc fflush fopen fclose fread fwrite fgets fseek ftell ferror "
        "feof perror FILE sscanf rename setvbuf rewind fscanf fileno tmpfile getchar",
    "ctime": "time_t tm time strftime gmtime localtime mktime clock_t difftime timespec",
    "csignal": "signal raise sig_atomic_t",
    "cctype": "isalnum isalpha isdigit iscntrl isspace isupper islower isxdigit isprint ispunct isgraph toupper tolower",
    "cstdarg": "va_list",
    "cfenv": "fesetround fegetround feclearexcept fetestexcept",
}
# Headers -> patterns of the macros, functions and types outside of std:: that each of them provides.
POSIX = {
    "cerrno errno.h":
        "errno EINTR EAGAIN EACCES ENOENT EPERM EPIPE ENODEV EINVAL ENOSPC ENXIO EBUSY EIO ETIMEDOUT EWOULDBLOCK EISDIR ELOOP "
        "EMFILE ENFILE ENOTTY EOVERFLOW EADDRINUSE ECONN[A-Z]+ ESHUTDOWN EREMOTEIO ENOMEM EBADF EEXIST EADDRNOTAVAIL ENOTDIR ENOTSUP "
        "ENOSYS ESRCH ECHILD",
    "ctime time.h sys/timerfd.h pthread.h sched.h":
        "CLOCK_[A-Z]+ TIMER_ABSTIME clock_gettime clock_nanosleep clock_getres gmtime_r localtime_r",
    "csignal signal.h sys/signalfd.h sys/wait.h spawn.h":
        "SIGINT SIGTERM SIGKILL SIGHUP SIGPIPE SIGSEGV SIGBUS SIGABRT SIGCHLD SIGUSR1 SIGUSR2 SIGXCPU SIGQUIT SIGSTOP SIGCONT SIGALRM "
        "SIGILL SIGFPE SIG_(?:DFL|IGN|ERR|BLOCK|SETMASK) SA_[A-Z]+ sigset_t sigemptyset sigaddset sigfillset sigprocmask",
    "csignal signal.h": "pthread_sigmask sigaltstack pthread_kill",
    "unistd.h":
        "STD(?:IN|OUT|ERR)_FILENO _SC_[A-Z_]+ pipe2 ftruncate getpid isatty geteuid sysconf usleep fsync fdatasync dup2 _exit execvp "
        "setsid readlink read write close unlink link pread pwrite access fork pipe lseek getuid chdir execve? sleep rmdir symlink",
    "fcntl.h": "O_[A-Z]+ F_[GS]ET[A-Z]+ AT_FDCWD posix_fallocate open openat fcntl",
    "poll.h": "POLL(?:IN|OUT|ERR|HUP|PRI|NVAL) pollfd poll ppoll",
    "pthread.h": r"pthread_(?!t\b|sigmask|kill|self)\w+",
    "sys/socket.h":
        "AF_(?:UNIX|INET6?) SOCK_[A-Z]+ SOL_SOCKET SO_[A-Z]+ MSG_[A-Z_]+ CMSG_[A-Z]+ SCM_RIGHTS setsockopt socketpair recvmsg sendmsg "
        "socket bind listen accept4? connect shutdown recv send getsockopt getsockname getpeername",
    "sys/mman.h":
        "PROT_[A-Z]+ MAP_(?:SHARED|FAILED|PRIVATE|POPULATE|ANONYMOUS|LOCKED) MFD_[A-Z_]+ MCL_[A-Z]+ mlockall munmap mmap memfd_create "
        "munlockall shm_open shm_unlink",
    "sys/epoll.h": r"EPOLL[A-Z_]+ epoll_\w+",
    "sys/file.h": "LOCK_(?:EX|SH|UN|NB) flock",
    "sys/resource.h": "RLIMIT_[A-Z]+ RUSAGE_[A-Z]+ PRIO_PROCESS [gs]etrlimit getrusage setpriority",
    "sched.h pthread.h": r"SCHED_(?:FIFO|OTHER|RR|BATCH|IDLE) CPU_(?:ZERO|SET|SETSIZE|COUNT|CLR|ISSET) cpu_set_t sched_\w+",
    "sys/timerfd.h": r"TFD_[A-Z]+ timerfd_\w+",
    "sys/signalfd.h": "SFD_[A-Z]+ signalfd signalfd_siginfo",
    "sys/wait.h": "WIF[A-Z]+ WEXITSTATUS WTERMSIG WNOHANG waitpid",
    "sys/stat.h": "S_I[RWXF][A-Z]+ S_IS[A-Z]+ fstat lstat fchmod mkfifo mkdir chmod umask",
    "sys/ioctl.h": "ioctl TIOC[A-Z]+",
    "sys/un.h": "sockaddr_un",
    "netinet/in.h": "sockaddr_in6? INADDR_[A-Z]+ IN6_[A-Z_]+ IPPROTO_IPV6",
    "netinet/tcp.h": "TCP_(?:NODELAY|KEEP[A-Z]+|USER_TIMEOUT|NOTSENT_LOWAT)",
    "arpa/inet.h": "inet_pton inet_ntop",
    "netdb.h": "AI_[A-Z]+ NI_[A-Z]+ getaddrinfo getnameinfo freeaddrinfo gai_strerror",
    "termios.h": r"TCSA[A-Z]+ TCI?O?FLUSH cfmakeraw tcsetattr tcgetattr cfset\w+",
    "sys/prctl.h": "PR_[SG]ET_[A-Z_]+ prctl",
    "sys/utsname.h": "uname utsname",
    "sys/random.h": "getrandom",
    "malloc.h": "M_(?:TRIM|MMAP)_[A-Z]+ mallopt mallinfo2",
    "semaphore.h": r"sem_\w+",
    "spawn.h": r"posix_spawn\w* POSIX_SPAWN_[A-Z]+",
    "cinttypes inttypes.h": "(?:PRI|SCN)[diouxX](?:8|16|32|64|PTR)",
    "cstdint stdint.h cinttypes": "U?INT(?:8|16|32|64|PTR|MAX)_(?:MAX|MIN|C)",
    "cstdio stdio.h unistd.h": "SEEK_(?:SET|CUR|END)",
    "cstdio stdio.h": "EOF stdout stderr stdin",
    "cmath math.h": "HUGE_VAL M_PI",
    "cstdlib stdlib.h": "EXIT_SUCCESS EXIT_FAILURE setenv unsetenv mkdtemp mkstemp mkostemp",
    "cstring string.h": "strsignal strerror_r",
    "cstdarg": "va_start va_end va_arg va_copy",
    "immintrin.h xmmintrin.h emmintrin.h": r"_mm_\w+ __m128d? __m256d?",
    "libusb.h": r"libusb_\w+ LIBUSB_\w+",
    "gpiod.h": r"gpiod_\w+ GPIOD_\w+",
    "libwebsockets.h": r"lws_\w+ LWS_\w+",
    "dds/dds.h": r"dds_\w+ DDS_\w+",
    "sys/syscall.h unistd.h": "syscall",
    "linux/usbdevice_fs.h": r"USBDEVFS_\w+ usbdevfs_\w+",
    "linux/serial.h": "serial_struct ASYNC_LOW_LATENCY",
}
# Namespaces of other libraries -> headers, by the beginning of their paths.
LIBRARIES = {"nlohmann": "nlohmann/json.hpp", "CLI": "CLI/CLI.hpp", "spdlog": "spdlog/", "Eigen": "Eigen/", "Assimp": "assimp/",
             "toml": "toml++/"}
PROPOSED = {"spdlog": "spdlog/spdlog.h", "Eigen": "Eigen/Core", "Assimp": "assimp/Importer.hpp", "toml": "toml++/toml.h"}
# GLM's headers include one another: <glm/geometric.hpp> has those of common, <glm/mat3x3.hpp> and <glm/gtc/quaternion.hpp> have most.
MATRICES = "glm/mat2x2.hpp glm/mat3x3.hpp glm/mat4x4.hpp glm/gtc/quaternion.hpp glm/glm.hpp"
GLM = {
    f"glm/vector_relational.hpp glm/common.hpp glm/geometric.hpp glm/matrix.hpp {MATRICES}":
        "all any not_ lessThan lessThanEqual greaterThan greaterThanEqual equal notEqual",
    f"glm/common.hpp glm/geometric.hpp glm/matrix.hpp {MATRICES}":
        "abs sign floor ceil round trunc fract mod min max clamp mix step smoothstep isnan isinf",
    f"glm/geometric.hpp glm/matrix.hpp {MATRICES}": "dot cross length distance normalize reflect faceforward",
    f"glm/matrix.hpp {MATRICES}": "transpose inverse determinant outerProduct matrixCompMult",
    "glm/trigonometric.hpp glm/gtc/quaternion.hpp glm/glm.hpp": "radians degrees sin cos tan asin acos atan",
    "glm/gtc/quaternion.hpp": "dquat quat conjugate mat3_cast mat4_cast quat_cast angleAxis slerp eulerAngles",
    f"glm/vec3.hpp glm/geometric.hpp glm/matrix.hpp {MATRICES}": "dvec3 vec3",
    "glm/vec2.hpp glm/matrix.hpp " + MATRICES: "dvec2 vec2",
    "glm/vec4.hpp glm/matrix.hpp " + MATRICES: "dvec4 vec4",
    "glm/mat3x3.hpp glm/matrix.hpp " + MATRICES: "dmat3 mat3",
    "glm/mat4x4.hpp glm/matrix.hpp " + MATRICES: "dmat4 mat4",
}

# One pass over the text: includes, comments, literals. Numbers match so that the ' of 1'000 opens no literal.
LEXEME = re.compile(r'(?P<include>^[ \t]*#[ \t]*include[^\n]*)|//[^\n]*|/\*.*?\*/'
                    r'|\bu?8?R"(?P<mark>[^\s()\\]*)\(.*?\)(?P=mark)"|"(?:\\.|[^"\\\n])*"'
                    r"|(?P<number>\b\d(?:'?[\w.])*)|'(?:\\.|[^'\\\n])+'", re.DOTALL | re.MULTILINE)
DIRECTIVE = re.compile(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", re.MULTILINE)
ENUM = re.compile(r"\benum\b[^;{()]*\{([^}]*)\}")
TYPE = r"(?:[A-Z]\w*[a-z]\w*|haptic_\w+)"
DEFINITION = re.compile(r"\b(?:class|struct|union|enum(?:\s+(?:class|struct))?)\s+(?:\[\[[^\]]*\]\]\s*|alignas\([^)]*\)\s*)*"
                        rf"({TYPE})\b[^;{{}}()]*\{{|\busing\s+({TYPE})\s*=|\bconcept\s+({TYPE})\b")
CONSTANT = re.compile(r"(?<=[\w>&*\]] )(k[A-Z]\w*)\s*(?:\[[^\]]*\]\s*)*(?:=|\{|$)")
FUNCTION_NAME = re.compile(r"(?!k[A-Z]|haptic_)[a-z]\w*")
NAMESPACE = re.compile(r"\bnamespace\s+([\w:]+)\s*\{")
FUNCTION = re.compile(r"(?<=[\w>&*\]] )([a-z]\w{3,})\s*\(")
FORWARD = r"\b(?:class|struct|union|enum(?:\s+class)?)\s+%s\s*(?::\s*[\w:]+\s*)?;"
# Words before a name that do not declare it.
NOT_A_TYPE = "(?:" + "|".join((
    "return co_return co_yield throw case else do new delete const constexpr static inline explicit friend virtual mutable volatile using "
    "typedef and or not in goto public private protected final override noexcept requires sizeof alignof operator extern constinit "
    "consteval thread_local if while for switch HAPTIC_RT HAPTIC_LANES").split()) + ")"


class File:
    """A source or header: its text without comments and literals, its includes, its words and where they stand."""

    def __init__(self, path: str, text: str) -> None:
        self.path = path
        self.includes: list[str] = []

        def blank(match: re.Match) -> str:
            if match["number"]:
                return match[0]
            if match["include"]:
                name = re.search(r'["<]([^">]+)[">]', match[0])
                self.includes += [name[1]] if name else []
                return ""
            return ('""' if match[0][-1] in "\"'" and match[0][0] != "/" else " ") + "\n" * match[0].count("\n")

        self.text = LEXEME.sub(blank, text)
        self.words = set(re.findall(r"[A-Za-z_]\w*", self.text))

    def line_of(self, position: int) -> int:
        return self.text.count("\n", 0, position) + 1

    def use_of(self, name: str, suffix: str = "", namespaces: frozenset[str] = frozenset()) -> int | None:
        """Position of the first use of a name, neither a member nor of a class or namespace other than those given."""
        for match in re.finditer(r"(\.|->|\w::|>::)?\b" + name + r"\b" + suffix, self.text):
            if match[1] and not match[1].endswith("::"):
                continue
            if match[1]:
                qualifier = re.search(r"(\w+)::$", self.text[max(0, match.start() - 60):match.end(1)])
                if not qualifier or qualifier[1] not in namespaces:
                    continue
            return match.start()
        return None

    def declares(self, name: str, suffix: str = "") -> bool:
        """Whether the text declares the name, followed by the suffix, in any way except a forward declaration."""
        after_type = (rf"(?:\b(?!{NOT_A_TYPE}\b)[A-Za-z_]\w*(?:\.\.\.)?\s+|(?<=[\w>\])])[&*>]+(?:\.\.\.)?\s+|"
                      r"\b(?:class|struct|enum|union)\s+\[\[[^\]]*\]\]\s+)"
                      rf"{name}\b(?!\s*::){suffix}")
        other = rf"\busing\s+{name}\s*=|\bauto\b[&\s]*\[[^\]]*\b{name}\b|#\s*define\s+{name}\b"
        if re.search(f"{after_type}|{other}", re.sub(FORWARD % name, "", self.text)):
            return True
        return any(re.search(r"\b" + name + r"\b\s*(?:=|,|$)", body.strip()) for body in ENUM.findall(self.text) if name in body)

    def access_through(self, name: str) -> int | None:
        """Position of the first access to a member through a variable of a type, up to the end of the function."""
        for match in re.finditer(r"\b" + name + r"(?:\s+const)?(?:[&*]\s*(?:const\s+)?|\s+)([a-z]\w*)\s*[,;)=:]", self.text):
            end = self.text.find("\n}", match.end())
            access = re.search(rf"(?<![\w.>:]){match[1]}(?:\.|->)\w", self.text[match.end():end])
            if access:
                return match.end() + access.start()
        return None

    def forward_declares(self, name: str) -> bool:
        return re.search(FORWARD % name, self.text) is not None


def at_namespace_scope(text: str) -> list[str]:
    """The declarations at namespace scope, without the contents of their braces; one that has a body ends in "{"."""
    text = DIRECTIVE.sub("", text)
    kept, depth, start = [], 0, 0  # depth: braces open that are no namespace's
    scopes: list[bool] = []
    for match in re.finditer(r"[{}]", text):
        if match[0] == "{":
            before = text[start:match.start()] if depth == 0 else ""
            if depth == 0:
                kept.append(before)
            namespace = depth == 0 and re.search(r'(?:\bnamespace\b[\s\w:]*|\bextern\s+"")\s*$', before) is not None
            if depth == 0:
                kept.append(";" if namespace else "{;" if before.count("(") == before.count(")") else "")
            scopes.append(namespace)
            depth += 0 if namespace else 1
        elif scopes:
            namespace = scopes.pop()
            if namespace and depth == 0:
                kept.append(text[start:match.start()] + ";")
            depth -= 0 if namespace else 1
        if depth == 0:
            start = match.end()
    kept.append(text[start:] if depth == 0 else "")
    return "".join(kept).split(";")


def defined_names(header: File) -> set[str]:
    """Types, constants, functions and HAPTIC_ macros that a header provides."""
    names = set(re.findall(r"#[ \t]*define[ \t]+(HAPTIC_\w+)", header.text))
    for statement in at_namespace_scope(header.text):
        statement = re.sub(r"\[\[.*?\]\]|\b(?:alignas|noexcept|decltype|HAPTIC_\w+)\s*\([^()]*\)", "", statement)
        statement = " ".join(statement.split())
        statement = re.sub(r"^template <.*?>(?= (?:class|struct|using|concept|inline|constexpr|void|\w))", "", statement)
        match = DEFINITION.search(statement)
        if match:
            names.add(match[1] or match[2] or match[3])
            continue
        head = statement.split("=")[0] + ("=" if "=" in statement else "")
        match = CONSTANT.search(head)
        if match and "(" not in head[:match.start()]:
            names.add(match[1])
            continue
        match = FUNCTION.search(head)
        if match and "(" not in head[:match.start()] and not head.startswith(("using ", "friend ")):
            names.add(match[1])
    return names


class Tree:
    """All files, and which headers define which names."""

    def __init__(self, root: Path) -> None:
        self.files: dict[str, File] = {}
        self.top: dict[str, str] = {}  # file -> its top-level folder
        for top in INCLUDE_DIRECTORIES:
            paths = [path for folder in ("src", "include") for path in (root / top / folder).rglob("*")]
            for path in sorted(path for path in paths if path.suffix in {".cpp", ".hpp", ".h"}):
                name = path.relative_to(root).as_posix()
                self.files[name] = File(name, path.read_text())
                self.top[name] = top
        opened = {names for file in self.files.values() for names in NAMESPACE.findall(file.text)}
        self.namespaces = frozenset(name for names in opened for name in names.split("::"))
        self.resolved_: dict[tuple[str, str], tuple[list[str], list[str]]] = {}
        definers: dict[str, set[str]] = {}
        for header in (file for file in self.files.values() if not file.path.endswith(".cpp")):
            for name in defined_names(header):
                definers.setdefault(name, set()).add(header.path)
        # Top-level folder -> name -> headers that define the name and that the folder can include.
        self.visible: dict[str, dict[str, set[str]]] = {}
        for top, directories in INCLUDE_DIRECTORIES.items():
            prefixes = tuple(f"{directory}/" for directory in directories)
            seen = {name: {header for header in headers if header.startswith(prefixes)} for name, headers in definers.items()}
            self.visible[top] = {name: headers for name, headers in seen.items() if headers}

    def resolved(self, top: str, path: str) -> tuple[list[str], list[str]]:
        """Headers of the project that a file includes, and the other ones, as seen from a source of the folder `top`."""
        if (top, path) not in self.resolved_:
            project, system = [], []
            for name in self.files[path].includes:
                places = [os.path.dirname(path), *INCLUDE_DIRECTORIES[top]]
                target = next((p for p in (os.path.normpath(f"{place}/{name}") for place in places) if p in self.files), None)
                project += [target] if target else []
                system += [] if target else [name]
            self.resolved_[top, path] = (project, system)
        return self.resolved_[top, path]

    def closure(self, path: str) -> set[str]:
        """The files that a file includes, directly or not, and itself."""
        seen, open_ = {path}, [path]
        while open_:
            new = set(self.resolved(self.top[path], open_.pop())[0]) - seen
            seen |= new
            open_ += new
        return seen


def by_name(table: dict[str, str]) -> dict[str, list[str]]:
    result: dict[str, list[str]] = {}
    for headers, names in table.items():
        for name in names.split():
            result.setdefault(name, []).extend(headers.split())
    return result


STANDARD_NAMES, GLM_NAMES = by_name(STANDARD), by_name(GLM)
POSIX_NAMES = [(headers.split(), re.compile("|".join(patterns.split()))) for headers, patterns in POSIX.items()]
NOT_CALLED = {"errno", "stdout", "stderr", "stdin", "pollfd", "sockaddr_un", "sockaddr_in", "sockaddr_in6", "signalfd_siginfo", "sigset_t",
              "cpu_set_t", "libusb_transfer", "libusb_context", "libusb_device_handle"}
POSIX_ANY = re.compile("|".join(pattern for patterns in POSIX.values() for pattern in patterns.split()))
STD_USE = re.compile(r"\bstd::(?:ranges::)?(\w+)")
GLM_USE = re.compile(r"\bglm::(\w+)")
LIBRARY_USE = re.compile(r"(?<![\w:])(" + "|".join(LIBRARIES) + r")::")
posix_headers: dict[str, list[str] | None] = {}


def headers_of_posix_name(word: str) -> list[str] | None:
    if word not in posix_headers:
        found = POSIX_ANY.fullmatch(word) and next(headers for headers, pattern in POSIX_NAMES if pattern.fullmatch(word))
        posix_headers[word] = found or None
    return posix_headers[word]


Declared = Callable[[str, bool], bool]


def missing_system_headers(file: File, system: set[str], declared: Declared,
                           namespace_declared: Callable[[str], bool]) -> list[tuple[int, str, str]]:
    """Position, name and header of the uses of names of libraries and system that no header provides."""
    found = []
    for pattern, names, prefix in ((STD_USE, STANDARD_NAMES, "std::"), (GLM_USE, GLM_NAMES, "glm::")):
        for name in set(pattern.findall(file.text)):
            if name in names and system.isdisjoint(names[name]):
                use = re.search(pattern.pattern.replace(r"(\w+)", name) + r"\b", file.text)
                found.append((use.start(), prefix + name, f"<{names[name][0]}>"))
    for name in set(LIBRARY_USE.findall(file.text)):
        if any(header.startswith(LIBRARIES[name]) for header in system):
            continue
        # Where the namespace is opened for forward declarations, references and pointers are passed on.
        forward = namespace_declared(name) or "nlohmann/json_fwd.hpp" in system and name == "nlohmann"
        use = re.search(rf"(?<![\w:]){name}::\w+" + (r"(?![\w&*;]| const[&*])" if forward else ""), file.text)
        at = file.access_through(rf"{name}::\w+") if forward and (not use or file.path.endswith(".hpp")) else use.start() if use else None
        if at is not None:
            found.append((at, f"{name}::", f"<{PROPOSED.get(name, LIBRARIES[name])}>"))
    for word in file.words:
        headers = headers_of_posix_name(word)
        if headers and system.isdisjoint(headers):
            called = word.islower() and word not in NOT_CALLED
            use = file.use_of(word, r"\s*\(" if called else "")
            if use is not None and not declared(word, called):
                found.append((use, word, f"<{headers[0]}>"))
    return found


def include_name(header: str) -> str:
    """How an include names a header of the project."""
    return re.sub(r"^[^/]+/(?:src|include)/", "", header)


def problems_of(tree: Tree, path: str) -> list[str]:
    top, file = tree.top[path], tree.files[path]
    visible = tree.visible[top]
    closure = tree.closure(path)
    system = {header for name in closure for header in tree.resolved(top, name)[1]}

    def declared(name: str, called: bool) -> bool:
        """Whether a file declares the name; that of a called function in another file only as a function."""
        return any(name in tree.files[f].words and tree.files[f].declares(name, r"\s*\(" if called and f != path else "") for f in closure)

    def namespace_declared(name: str) -> bool:
        return any(name in tree.files[f].words and re.search(rf"\bnamespace {name}\b", tree.files[f].text) for f in closure)

    found = missing_system_headers(file, system, declared, namespace_declared)
    for name in file.words & visible.keys():
        if not closure.isdisjoint(visible[name]):
            continue
        function = FUNCTION_NAME.fullmatch(name) is not None
        use = file.use_of(name, r"\s*\(" if function else "", tree.namespaces)
        if use is None or declared(name, function):
            continue
        if any(tree.files[f].forward_declares(name) for f in closure):
            use = file.use_of(name, r"(?:::\w|\{)", tree.namespaces) or file.access_through(name)
            if use is None:
                continue
        found.append((use, name, f'"{include_name(sorted(visible[name])[0])}"'))
    return [f"{path}:{file.line_of(at)}: {name} needs #include {header}" for at, name, header in sorted(found)]


def check(root: Path, tops: list[str]) -> list[str]:
    tree = Tree(root)
    return [problem for path in tree.files if tree.top[path] in tops for problem in problems_of(tree, path)]


def main() -> int:
    problems = check(Path(sys.argv[1]), sys.argv[2:] or list(INCLUDE_DIRECTORIES))
    print("\n".join(problems) or "Each file includes what it uses.")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
