# The two ways in which this project makes a target, so that no folder repeats them:
#   haptic_library(NAME)                    a static library, exported as haptic::NAME
#   haptic_executable(NAME COMPONENT)       an executable, installed with that component
# Both take sources with target_sources() afterwards. A component is one package (HapticPackages.cmake): rt_core, host_sim,
# and dev for what others build against.

# Flags that hold for everything that is built here, and for nothing that a user builds against us.
add_library(haptic_options INTERFACE)
target_compile_features(haptic_options INTERFACE cxx_std_20)
target_compile_options(haptic_options INTERFACE
    -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor>
    # The same operations on each machine and compiler, so that a recorded state can be compared bit for bit.
    -ffp-contract=off
    $<$<BOOL:${HAPTIC_WARNINGS_AS_ERRORS}>:-Werror>)
# g++ 12 warns of "a" + std::string (GCC bug 105651), which g++ 13 no longer does.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
    target_compile_options(haptic_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-Wno-restrict>)
endif()
# Of ARM's calling convention g++ remarks what changed in its version 10: nothing that is built here is that old.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_SYSTEM_PROCESSOR STREQUAL "aarch64")
    target_compile_options(haptic_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-Wno-psabi>)
endif()
if(HAPTIC_SANITIZE)
    target_compile_options(haptic_options INTERFACE -fsanitize=${HAPTIC_SANITIZE} -fno-omit-frame-pointer)
    if(HAPTIC_SANITIZE MATCHES undefined)
        target_compile_options(haptic_options INTERFACE -fno-sanitize-recover=undefined)
    endif()
    target_link_options(haptic_options INTERFACE -fsanitize=${HAPTIC_SANITIZE})
endif()

# HAPTIC_RT_CHECKS is on where the compiler can prove the real-time contract (clang 20 or newer).
if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang" AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 20)
    target_compile_options(haptic_options INTERFACE
        $<$<COMPILE_LANGUAGE:CXX>:-Wfunction-effects> $<$<COMPILE_LANGUAGE:CXX>:-Werror=function-effects>)
endif()

function(haptic_library name)
    string(REPLACE "-" "_" target ${name})
    add_library(haptic_${target} STATIC)
    add_library(haptic::${target} ALIAS haptic_${target})
    set_target_properties(haptic_${target} PROPERTIES EXPORT_NAME ${target} CXX_EXTENSIONS OFF
                          POSITION_INDEPENDENT_CODE ON)
    target_compile_features(haptic_${target} PUBLIC cxx_std_20)
    target_include_directories(haptic_${target}
        PUBLIC $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>
               $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/src>)
    target_link_libraries(haptic_${target} PRIVATE $<BUILD_INTERFACE:haptic_options>)
    install(TARGETS haptic_${target} EXPORT hapticTargets COMPONENT dev)
    install(DIRECTORY include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev)
endfunction()

function(haptic_executable name component)
    add_executable(${name})
    set_target_properties(${name} PROPERTIES CXX_EXTENSIONS OFF)
    target_link_libraries(${name} PRIVATE haptic_options)
    # All symbols are bound when the process starts: the first call of a library's function is no slower than the next.
    target_link_options(${name} PRIVATE LINKER:-z,relro,-z,now)
    install(TARGETS ${name} COMPONENT ${component})
endfunction()

# haptic_configuration(FOLDER COMPONENT FILES...): installs files that a user edits to FOLDER of <prefix>/etc, which is /etc
# itself where the prefix is /usr. That is asked when they are installed, because the prefix may be given only then.
function(haptic_configuration folder component)
    foreach(file IN LISTS ARGN)
        cmake_path(ABSOLUTE_PATH file)
        install(CODE "
            set(etc \"\${CMAKE_INSTALL_PREFIX}/etc\")
            if(CMAKE_INSTALL_PREFIX MATCHES \"^/(usr/?)?$\")
                set(etc /etc)
            endif()
            file(INSTALL \"${file}\" DESTINATION \"\${etc}/${folder}\")" COMPONENT ${component})
    endforeach()
endfunction()

# haptic_test(NAME LABEL label SOURCES ... LIBRARIES ...): one GoogleTest executable, each test known to ctest. Tests run
# beside others unless it is ALONE, as those are that go by the clock or have threads that wait for each other. COST: what
# takes longest begins first.
function(haptic_test name)
    cmake_parse_arguments(arg "ALONE" "LABEL;TIMEOUT;COST;ENVIRONMENT" "SOURCES;LIBRARIES;DEFINITIONS" ${ARGN})
    if(NOT arg_TIMEOUT)
        set(arg_TIMEOUT 120)
    endif()
    if(NOT arg_COST)
        set(arg_COST 0)
    endif()
    add_executable(${name} ${arg_SOURCES})
    set_target_properties(${name} PROPERTIES CXX_EXTENSIONS OFF)
    target_link_libraries(${name} PRIVATE haptic_options ${arg_LIBRARIES} GTest::gmock GTest::gtest_main)
    # Headers that several tests share are at the root of their folder of tests.
    target_include_directories(${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
    target_compile_definitions(${name} PRIVATE ${arg_DEFINITIONS})
    if(TARGET haptic_test_headers)
        target_precompile_headers(${name} REUSE_FROM haptic_test_headers)
    endif()
    gtest_discover_tests(${name} NO_PRETTY_VALUES DISCOVERY_TIMEOUT 60 PROPERTIES LABELS ${arg_LABEL} TIMEOUT ${arg_TIMEOUT}
                         RUN_SERIAL ${arg_ALONE} COST ${arg_COST} ENVIRONMENT "${arg_ENVIRONMENT}")
endfunction()

# haptic_benchmark(NAME SOURCES ... LIBRARIES ...): one Google Benchmark executable, run by toolchain/bench.
function(haptic_benchmark name)
    cmake_parse_arguments(arg "" "" "SOURCES;LIBRARIES" ${ARGN})
    add_executable(${name} ${arg_SOURCES})
    set_target_properties(${name} PROPERTIES CXX_EXTENSIONS OFF)
    target_link_libraries(${name} PRIVATE haptic_options ${arg_LIBRARIES} benchmark::benchmark)
    # The library's macros use __COUNTER__, which newer clang reports as an extension.
    if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang" AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 22)
        set_source_files_properties(${arg_SOURCES} PROPERTIES COMPILE_OPTIONS -Wno-c2y-extensions)
    endif()
endfunction()
