# The Debian packages haptic-rt-core, haptic-host-sim, libhaptic0, libhaptic-dev and, where it is built, python3-haptic, one for
# each component, and their debug symbols: toolchain/package makes them.
set(HAPTIC_MAINTAINER "The haptic project's authors <root@localhost>" CACHE STRING "Who answers for the Debian packages: Name <address>")
set(debian ${CMAKE_CURRENT_LIST_DIR}/../debian)

# haptic_package(COMPONENT NAME SECTION SUMMARY TEXT): sets the variables of one package. TEXT is its description, in lines of
# at most 76 characters. dpkg-shlibdeps finds the libraries that its programs depend on.
function(haptic_package component name section summary text)
    string(TOUPPER ${component} upper)
    set(prefix CPACK_DEBIAN_${upper}_PACKAGE)
    set(${prefix}_NAME ${name} PARENT_SCOPE)
    set(${prefix}_SECTION ${section} PARENT_SCOPE)
    set(CPACK_COMPONENT_${upper}_DESCRIPTION "${summary}\n${text}" PARENT_SCOPE)
    install(FILES ${debian}/copyright DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${name} COMPONENT ${component})
    install(FILES ${CMAKE_CURRENT_BINARY_DIR}/changelog.gz DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${name} COMPONENT ${component})
endfunction()

# Debian's changelog names the version; CHANGELOG.md describes the changes. No time, so that the same tree makes the same
# package.
file(CONFIGURE OUTPUT changelog CONTENT "haptic (@PROJECT_VERSION@) bookworm; urgency=medium

  * CHANGELOG.md of the source says what changed.

 -- @HAPTIC_MAINTAINER@  Thu, 01 Jan 1970 00:00:00 +0000
" @ONLY)
execute_process(COMMAND gzip -9nc ${CMAKE_CURRENT_BINARY_DIR}/changelog OUTPUT_FILE ${CMAKE_CURRENT_BINARY_DIR}/changelog.gz
                COMMAND_ERROR_IS_FATAL ANY)

haptic_package(rt_core haptic-rt-core science "real-time process of a Spidar-G6 haptic device"
"rt-core drives the eight strings of a Spidar-G6 a thousand times a second
and renders contact planes as force and torque. firmware-host emulates the
device and serves the emulation as a USB or serial board. With them come a
service, which nothing starts by itself, and the rules by which a user who
is not root may run it in real time.")
haptic_package(host_sim haptic-host-sim science "simulation of deformable objects for a haptic device"
"host-sim computes deformable objects, cloth and rigid tools in contact, and
sends the planes of contact to rt-core by shared memory. With it come its
scenes and a service, which nothing starts by itself.")
haptic_package(lib libhaptic0 libs "connects a simulator to a haptic device"
"libhaptic lets any simulator push contact planes to rt-core, which renders
them on a Spidar-G6, and read the device's state. Both go through shared
memory. This package has the library for programs that were built with it.")
haptic_package(dev libhaptic-dev libdevel "connects a simulator to a haptic device (development files)"
"What a simulator is built with: C headers, a CMake package,
find_package(haptic), a pkg-config file, and examples in C, C++, C# and
MATLAB.")
get_directory_property(python_found DIRECTORY ${PROJECT_SOURCE_DIR}/host-sim DEFINITION HAPTIC_PYTHON_FOUND)
if(python_found)
    haptic_package(python python3-haptic python "simulation of deformable objects for a haptic device (Python 3)"
"The package haptic has the scenes of host-sim, step by step and as numpy
arrays, contact queries, virtual tests of materials, and the session with
rt-core, which renders contact planes on a Spidar-G6.")
    install(FILES ${PROJECT_SOURCE_DIR}/host-sim/docs/python.md DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/python3-haptic COMPONENT python)
    # One version of the interpreter can load it.
    get_directory_property(python DIRECTORY ${PROJECT_SOURCE_DIR}/host-sim/python DEFINITION Python_VERSION_MINOR)
    math(EXPR next_python "${python} + 1")
    set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= 3.${python}), python3 (<< 3.${next_python}), python3-numpy")
    set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "parallel")
    set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "haptic-host-sim, haptic-rt-core, python3-matplotlib")
    set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
    set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${debian}/python3-haptic/postinst ${debian}/python3-haptic/prerm)
endif()

install(FILES ${PROJECT_SOURCE_DIR}/rt-core/README.md DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/haptic-rt-core COMPONENT rt_core)
install(FILES ${PROJECT_SOURCE_DIR}/host-sim/README.md DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/haptic-host-sim COMPONENT host_sim)
install(FILES ${PROJECT_SOURCE_DIR}/shared/docs/contact-frame.md ${PROJECT_SOURCE_DIR}/shared/docs/other-simulators.md
        DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libhaptic-dev COMPONENT dev)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/shared/examples DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libhaptic-dev COMPONENT dev
        PATTERN build EXCLUDE)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME haptic)
# Each package has its own summary.
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")
set(CPACK_PACKAGE_CONTACT "${HAPTIC_MAINTAINER}")
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL rt_core host_sim lib dev)
if(python_found)
    list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
# Each package of programs and its debug symbols, NAME-dbgsym, which a debugger finds by the program's build id.
set(CPACK_DEBIAN_DEBUGINFO_PACKAGE ON)
# Quickly: toolchain/package compresses them well.
set(CPACK_DEBIAN_COMPRESSION_TYPE gzip)
# The prefix is /usr itself, not a folder to prepend, so haptic_configuration() installs to /etc.
set(CPACK_SET_DESTDIR ON)
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
    OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

if(CMAKE_SYSTEM_PROCESSOR STREQUAL "aarch64")
    set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE arm64)
elseif(CMAKE_SYSTEM_PROCESSOR STREQUAL "x86_64")
    set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE amd64)
endif()

set(sysusers "systemd | systemd-standalone-sysusers | systemd-sysusers")
set(CPACK_DEBIAN_RT_CORE_PACKAGE_DEPENDS "${sysusers}")
set(CPACK_DEBIAN_RT_CORE_PACKAGE_RECOMMENDS "udev")
set(CPACK_DEBIAN_RT_CORE_PACKAGE_SUGGESTS "haptic-host-sim, gnuplot-nox, rt-tests, stress-ng")
set(CPACK_DEBIAN_HOST_SIM_PACKAGE_DEPENDS "${sysusers}")
set(CPACK_DEBIAN_HOST_SIM_PACKAGE_SUGGESTS "haptic-rt-core, gnuplot-nox, povray")
# Programs that were built with this version may call functions that an older one lacks.
set(CPACK_DEBIAN_LIB_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY ">=")
set(CPACK_DEBIAN_LIB_PACKAGE_CONTROL_EXTRA ${debian}/libhaptic0/triggers)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "libhaptic0 (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS "haptic-rt-core, libbullet-dev")
# Its name until version 0.1, when it had static C++ libraries.
set(CPACK_DEBIAN_DEV_PACKAGE_CONFLICTS "haptic-dev")
set(CPACK_DEBIAN_DEV_PACKAGE_REPLACES "haptic-dev")
set(CPACK_DEBIAN_DEV_PACKAGE_PROVIDES "haptic-dev")
foreach(component IN ITEMS rt_core host_sim)
    string(TOUPPER ${component} upper)
    string(REPLACE "_" "-" name haptic-${component})
    set(CPACK_DEBIAN_${upper}_PACKAGE_SHLIBDEPS ON)
    set(CPACK_DEBIAN_${upper}_PACKAGE_CONTROL_EXTRA
        ${debian}/postinst ${debian}/prerm ${debian}/postrm ${debian}/${name}/conffiles)
endforeach()
# Dependencies of cross-built programs come from the packages of the sysroot, and their debug symbols are cut off by its objcopy.
if(CMAKE_CROSSCOMPILING)
    get_filename_component(CPACK_HAPTIC_PACKAGES "${HAPTIC_SYSROOT}/../packages" ABSOLUTE)
    set(CPACK_PROJECT_CONFIG_FILE ${CMAKE_CURRENT_LIST_DIR}/cross-packages.cmake)
endif()
include(CPack)
