# Toolchain for 64-bit ARM on any Debian: compiler and C library of Debian's cross compiler, all other libraries and headers
# of Debian's arm64 packages, which toolchain/cross unpacks into the sysroot.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)

set(HAPTIC_SYSROOT "${CMAKE_CURRENT_LIST_DIR}/../../build/sysroot/arm64/root" CACHE PATH
    "Unpacked arm64 packages, as toolchain/cross leaves them")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES HAPTIC_SYSROOT)
get_filename_component(sysroot "${HAPTIC_SYSROOT}" ABSOLUTE)
if(NOT EXISTS "${sysroot}/usr/lib/aarch64-linux-gnu/pkgconfig")
    message(FATAL_ERROR "no arm64 libraries in ${sysroot}: toolchain/cross puts them there")
endif()

# Find programs on this machine; find headers and libraries only in the sysroot.
set(CMAKE_FIND_ROOT_PATH "${sysroot}" /usr/aarch64-linux-gnu)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_LIBDIR} "${sysroot}/usr/lib/aarch64-linux-gnu/pkgconfig:${sysroot}/usr/share/pkgconfig")
set(ENV{PKG_CONFIG_SYSROOT_DIR} "${sysroot}")

# Architecture-dependent headers, such as OpenSSL's, which libwebsockets includes. Last, because the C library's are there,
# too, and the compiler has its own.
set(CMAKE_C_FLAGS_INIT "-idirafter ${sysroot}/usr/include/aarch64-linux-gnu")
set(CMAKE_CXX_FLAGS_INIT "-idirafter ${sysroot}/usr/include/aarch64-linux-gnu")

# The linker finds the dependencies of our libraries here.
set(link_flags "-Wl,-rpath-link,${sysroot}/usr/lib/aarch64-linux-gnu:${sysroot}/lib/aarch64-linux-gnu")
set(CMAKE_EXE_LINKER_FLAGS_INIT "${link_flags}")
set(CMAKE_SHARED_LINKER_FLAGS_INIT "${link_flags}")

# Tests run under QEMU's user emulation, if installed, with the sysroot's C library.
find_program(HAPTIC_QEMU_AARCH64 qemu-aarch64-static)
if(HAPTIC_QEMU_AARCH64)
    set(CMAKE_CROSSCOMPILING_EMULATOR "${HAPTIC_QEMU_AARCH64};-L;${sysroot}")
endif()
