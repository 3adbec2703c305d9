# Read by cpack before it packages cross-built programs. Their libraries are not installed here: dpkg-shlibdeps finds each in
# the folder of its unpacked package (-S), with that package's versions of its symbols.
file(GLOB packages LIST_DIRECTORIES TRUE "${CPACK_HAPTIC_PACKAGES}/*")
if(NOT packages)
    message(FATAL_ERROR "no unpacked packages in ${CPACK_HAPTIC_PACKAGES}: toolchain/cross puts them there")
endif()
list(TRANSFORM packages PREPEND -S)
# CPack calls the programs in these variables.
set(SHLIBDEPS_EXECUTABLE dpkg-shlibdeps ${packages})
set(CPACK_OBJCOPY_EXECUTABLE aarch64-linux-gnu-objcopy)
set(ENV{DEB_HOST_ARCH} ${CPACK_DEBIAN_PACKAGE_ARCHITECTURE})
