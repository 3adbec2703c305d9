# Functions that make the targets of this project:
#   haptic_internal_library(NAME [COMMANDS])  a static library, haptic::NAME, whose headers lie beside its sources
#   haptic_library(NAME)                      one whose public headers lie in include/, for the other folders
#   haptic_executable(NAME COMPONENT)         an executable, installed with that component
# All take sources with target_sources() afterwards. A component is one package (HapticPackages.cmake): rt_core, host_sim,
# lib for the library of other simulators (shared/CMakeLists.txt), and dev for what they are built with.

# Flags for everything that is built here, and for nothing that a user builds against it.
add_library(haptic_options INTERFACE)
target_compile_features(haptic_options INTERFACE cxx_std_20)
target_compile_options(haptic_options INTERFACE
    -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor>
    # The same floating-point operations on each machine and compiler, so that states can be compared bit for bit.
    -ffp-contract=off
    # Nobody reads errno or the floating-point flags: roots take no branch, and choices of several lanes are made at a time.
    -fno-math-errno -fno-trapping-math
    # Calls within a library may be inlined, as clang always does.
    -fno-semantic-interposition
    $<$<BOOL:${HAPTIC_WARNINGS_AS_ERRORS}>:-Werror>)
# With vectors, Eigen adds in an order that differs between machines. Its functions are shared by all objects of a program.
target_compile_definitions(haptic_options INTERFACE EIGEN_DONT_VECTORIZE)
# g++ 12 warns of "a" + std::string (GCC bug 105651), which g++ 13 no longer does.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
    target_compile_options(haptic_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-Wno-restrict>)
endif()
# g++ 14 warns falsely of std::vector's insert() and of a copied std::optional. g++ 12 and clang still look for these errors.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 14)
    target_compile_options(haptic_options INTERFACE
        $<$<COMPILE_LANGUAGE:CXX>:-Wno-stringop-overflow> $<$<COMPILE_LANGUAGE:CXX>:-Wno-maybe-uninitialized>)
endif()
# g++ notes that ARM's calling convention changed in its version 10. Nothing that is built here is that old.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_SYSTEM_PROCESSOR STREQUAL "aarch64")
    target_compile_options(haptic_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-Wno-psabi>)
endif()
# g++ looks for memory that it can use again only once it has 500 MB, a tenth of the time to compile otherwise.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(haptic_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:--param=ggc-min-heapsize=500000>)
endif()
if(HAPTIC_SANITIZE)
    target_compile_options(haptic_options INTERFACE -fsanitize=${HAPTIC_SANITIZE} -fno-omit-frame-pointer)
    if(HAPTIC_SANITIZE MATCHES undefined)
        target_compile_options(haptic_options INTERFACE -fno-sanitize-recover=undefined)
        if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
            # Headers of others need not be checked in every source that includes them, a quarter of the time to compile.
            # What our sources do with the standard library's classes is checked by its own assertions.
            target_compile_options(haptic_options INTERFACE
                -fsanitize-ignorelist=${CMAKE_CURRENT_SOURCE_DIR}/toolchain/cmake/unsanitized.txt)
            target_compile_definitions(haptic_options INTERFACE _GLIBCXX_ASSERTIONS)
        endif()
    endif()
    target_link_options(haptic_options INTERFACE -fsanitize=${HAPTIC_SANITIZE})
endif()

# clang 20 or newer proves the real-time contract.
if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang" AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 20)
    target_compile_options(haptic_options INTERFACE
        $<$<COMPILE_LANGUAGE:CXX>:-Wfunction-effects> $<$<COMPILE_LANGUAGE:CXX>:-Werror=function-effects>)
endif()

# Whether headers are precompiled and sources joined: not for a launcher like ccache, which keeps the objects of single sources.
set(haptic_joins OFF)
if(HAPTIC_PRECOMPILE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
    set(haptic_joins ON)
endif()

# Headers that most sources include: a third of the time that a source takes to compile goes into them. A build without
# HAPTIC_PRECOMPILE shows whether each source includes what it uses; tests/structure/check_self_contained.py looks for it.
set(haptic_common_headers "")
foreach(header IN ITEMS algorithm array cmath cstdint functional memory optional span stdexcept string string_view utility vector
        glm/geometric.hpp glm/gtc/quaternion.hpp glm/mat3x3.hpp glm/vec3.hpp)
    list(APPEND haptic_common_headers $<$<COMPILE_LANGUAGE:CXX>:<${header}$<ANGLE-R>>)
endforeach()

# g++ 12 suppresses its false warnings about joined strings (GCC bug 105651) in system headers, but not in precompiled ones.
# It takes a source that is compiled as part of another for a header, whose classes other sources would see.
set(haptic_precompiled_options
    $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-subobject-linkage>
    $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-array-bounds> $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-stringop-overflow>
    $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-stringop-overread>)

# Only what a tick or a step computes is optimised as far as the build type says. Anything else takes a third less time to
# compile in Release builds, and half of it in Debug builds, which run the tests under sanitizers.
set(haptic_hardly_optimised $<$<CONFIG:Debug>:-O0> $<$<CONFIG:Release>:-O1>)

# Precompiled once for all libraries that are optimised alike.
if(haptic_joins)
    file(CONFIGURE OUTPUT empty.cpp CONTENT "")
    foreach(optimised IN ITEMS fully hardly)
        add_library(haptic_${optimised}_headers OBJECT ${CMAKE_CURRENT_BINARY_DIR}/empty.cpp)
        set_target_properties(haptic_${optimised}_headers PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
        target_link_libraries(haptic_${optimised}_headers PRIVATE haptic_options)
        target_compile_options(haptic_${optimised}_headers PRIVATE ${haptic_precompiled_options})
        target_precompile_headers(haptic_${optimised}_headers PRIVATE ${haptic_common_headers})
    endforeach()
    target_compile_options(haptic_hardly_headers PRIVATE ${haptic_hardly_optimised})
endif()

# Sources that are compiled as one: those of each folder of a library, and half as many of a test. Twice as many save a third of
# the time; a compiler then takes up to 40 s.
set(haptic_sources_together 32)

# haptic_join_sources(TARGET): compiles the sources of a folder together, which saves time: much of what a source takes goes
# into code of Debian's headers, which each emits again. So within a folder no two sources use a name differently.
function(haptic_join_sources target)
    get_target_property(sources ${target} SOURCES)
    foreach(source IN LISTS sources)
        cmake_path(GET source PARENT_PATH folder)
        list(APPEND sources_of_${folder} ${source})
        list(LENGTH sources_of_${folder} count)
        math(EXPR unit "(${count} - 1) / ${haptic_sources_together}")
        set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${folder}/${unit})
    endforeach()
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
endfunction()

# haptic_join_sources_later(TARGET): the same, once the caller has named the sources.
function(haptic_join_sources_later target)
    if(haptic_joins)
        cmake_language(EVAL CODE "cmake_language(DEFER CALL haptic_join_sources ${target})")
    endif()
endfunction()

# haptic_internal_library(NAME [COMMANDS]): a static library, haptic::NAME. Its headers lie beside its sources, in the caller's
# src/. COMMANDS: no tick and no step computes in it.
function(haptic_internal_library name)
    cmake_parse_arguments(arg "COMMANDS" "" "" ${ARGN})
    string(REPLACE "-" "_" target ${name})
    add_library(haptic_${target} STATIC)
    add_library(haptic::${target} ALIAS haptic_${target})
    set_target_properties(haptic_${target} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON
                          HAPTIC_SOURCE_DIR ${CMAKE_CURRENT_SOURCE_DIR}/src)
    target_compile_features(haptic_${target} PUBLIC cxx_std_20)
    target_include_directories(haptic_${target} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/src)
    target_link_libraries(haptic_${target} PRIVATE haptic_options)
    set(optimised fully)
    if(arg_COMMANDS)
        set(optimised hardly)
        target_compile_options(haptic_${target} PRIVATE ${haptic_hardly_optimised})
    endif()
    if(haptic_joins)
        target_precompile_headers(haptic_${target} REUSE_FROM haptic_${optimised}_headers)
        target_compile_options(haptic_${target} PRIVATE ${haptic_precompiled_options})
    endif()
    haptic_join_sources_later(haptic_${target})
endfunction()

# haptic_library(NAME): the same, with the caller's include/ for those that link it.
function(haptic_library name)
    haptic_internal_library(${name})
    string(REPLACE "-" "_" target ${name})
    target_include_directories(haptic_${target} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/include)
endfunction()

function(haptic_executable name component)
    add_executable(${name})
    set_target_properties(${name} PROPERTIES CXX_EXTENSIONS OFF)
    target_link_libraries(${name} PRIVATE haptic_options)
    target_compile_options(${name} PRIVATE ${haptic_hardly_optimised})
    if(haptic_joins)
        set_target_properties(${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${haptic_sources_together})
    endif()
    # Bind all symbols at start, so that the first call of a library function is no slower than the next.
    target_link_options(${name} PRIVATE LINKER:-z,relro,-z,now)
    install(TARGETS ${name} COMPONENT ${component})
endfunction()

# haptic_configuration(FOLDER COMPONENT FILES...): installs files that a user edits to FOLDER of <prefix>/etc, or of /etc if
# the prefix is /usr. The prefix is evaluated at installation, because it may be given only then.
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

# haptic_manual(COMPONENT PAGES...): installs man pages, compressed as Debian wants them.
function(haptic_manual component)
    file(MAKE_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/man)
    foreach(page IN LISTS ARGN)
        cmake_path(ABSOLUTE_PATH page)
        cmake_path(GET page FILENAME name)
        string(REGEX MATCH "[0-9]$" section ${name})
        set(compressed ${CMAKE_CURRENT_BINARY_DIR}/man/${name}.gz)
        add_custom_command(OUTPUT ${compressed} COMMAND gzip -9nc ${page} > ${compressed} DEPENDS ${page})
        add_custom_target(${name}-page ALL DEPENDS ${compressed})
        install(FILES ${compressed} DESTINATION ${CMAKE_INSTALL_MANDIR}/man${section} COMPONENT ${component})
    endforeach()
endfunction()

# haptic_completion(COMPONENT PROGRAM FOLDER): installs FOLDER/PROGRAM.bash, FOLDER/_PROGRAM (zsh) and FOLDER/PROGRAM.fish.
# Debian's zsh reads vendor-completions below /usr, and site-functions below /usr/local.
function(haptic_completion component program folder)
    install(FILES ${folder}/${program}.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
            RENAME ${program} COMPONENT ${component})
    install(FILES ${folder}/${program}.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT ${component})
    install(CODE "
        set(zsh site-functions)
        if(CMAKE_INSTALL_PREFIX MATCHES \"^/(usr/?)?$\")
            set(zsh vendor-completions)
        endif()
        file(INSTALL \"${folder}/_${program}\"
             DESTINATION \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATADIR}/zsh/\${zsh}\")" COMPONENT ${component})
endfunction()

# haptic_documents(PROGRAM COMPONENT MAN pages... FILES files... SCHEMA file): runs PROGRAM --generate, which writes its man pages, its
# shell completion and further files to documents/ of the build folder; installs pages and completion. A cross-built
# program runs under the emulator of the toolchain file.
function(haptic_documents program component)
    cmake_parse_arguments(arg "" "SCHEMA" "MAN;FILES" ${ARGN})
    if(CMAKE_CROSSCOMPILING AND NOT CMAKE_CROSSCOMPILING_EMULATOR)
        message(FATAL_ERROR "${program} writes its man pages itself, which needs qemu-aarch64-static: toolchain/setup cross")
    endif()
    set(folder ${CMAKE_CURRENT_BINARY_DIR}/documents)
    set(outputs ${arg_MAN} ${arg_FILES} ${arg_SCHEMA} ${program}.bash _${program} ${program}.fish)
    list(TRANSFORM outputs PREPEND ${folder}/)
    add_custom_command(OUTPUT ${outputs} COMMAND ${program} --generate ${folder} DEPENDS ${program}
                       COMMENT "Writing the documents of ${program}")
    add_custom_target(${program}-documents ALL DEPENDS ${outputs})
    list(TRANSFORM arg_MAN PREPEND ${folder}/)
    haptic_manual(${component} ${arg_MAN})
    haptic_completion(${component} ${program} ${folder})
    if(arg_SCHEMA)
        install(FILES ${folder}/${arg_SCHEMA} DESTINATION ${CMAKE_INSTALL_DATADIR}/haptic COMPONENT ${component})
    endif()
endfunction()

# haptic_uses_private_headers(TARGET LIBRARIES...): lets a test include what these libraries keep beside their sources.
function(haptic_uses_private_headers target)
    foreach(library IN LISTS ARGN)
        get_target_property(folder ${library} HAPTIC_SOURCE_DIR)
        if(folder)
            target_include_directories(${target} PRIVATE ${folder})
        endif()
    endforeach()
endfunction()

# haptic_test(NAME LABEL label SOURCES ... LIBRARIES ...): one GoogleTest executable, with each of its tests known to ctest.
# Tests run in parallel unless they are ALONE, as tests with real time or several threads are. COST: the longest start first.
# Long versions of tests, LABEL soak, have "Soak/" before their names: ctest gives properties to all tests of one name.
# SEPARATE: the sources replace functions of a library or are not all C++, and cannot be compiled as one to save time.
function(haptic_test name)
    cmake_parse_arguments(arg "ALONE;SEPARATE" "LABEL;TIMEOUT;COST;ENVIRONMENT" "SOURCES;LIBRARIES;DEFINITIONS" ${ARGN})
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
    target_include_directories(${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/tests/unit/shared)
    haptic_uses_private_headers(${name} ${arg_LIBRARIES})
    target_compile_definitions(${name} PRIVATE ${arg_DEFINITIONS})
    if(TARGET haptic_test_headers)
        target_precompile_headers(${name} REUSE_FROM haptic_test_headers)
        if(NOT arg_SEPARATE)
            math(EXPR together "${haptic_sources_together} / 2")
            set_target_properties(${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${together})
        endif()
    endif()
    set(properties LABELS ${arg_LABEL} RUN_SERIAL ${arg_ALONE} COST ${arg_COST})
    if(arg_ENVIRONMENT)
        list(APPEND properties ENVIRONMENT ${arg_ENVIRONMENT})
    endif()
    if(HAPTIC_SANITIZE MATCHES "address")
        # Under the address sanitizer a process takes longer to start than most tests to run: one process for all of them.
        add_test(NAME ${name} COMMAND ${name} --gtest_brief=1)
        set_tests_properties(${name} PROPERTIES ${properties} TIMEOUT 1200)
    else()
        set(prefix "")
        if(arg_LABEL STREQUAL "soak")
            set(prefix TEST_PREFIX Soak/)
        endif()
        gtest_discover_tests(${name} NO_PRETTY_VALUES DISCOVERY_TIMEOUT 60 ${prefix}
            PROPERTIES ${properties} TIMEOUT ${arg_TIMEOUT})
    endif()
endfunction()

# haptic_benchmark(NAME SOURCES ... LIBRARIES ...): one Google Benchmark executable, run by toolchain/bench.
function(haptic_benchmark name)
    cmake_parse_arguments(arg "" "" "SOURCES;LIBRARIES" ${ARGN})
    add_executable(${name} ${arg_SOURCES})
    set_target_properties(${name} PROPERTIES CXX_EXTENSIONS OFF)
    target_link_libraries(${name} PRIVATE haptic_options ${arg_LIBRARIES} benchmark::benchmark)
    haptic_uses_private_headers(${name} ${arg_LIBRARIES})
    # The library's macros use __COUNTER__, which newer versions of clang report as an extension.
    if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang" AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 22)
        set_source_files_properties(${arg_SOURCES} PROPERTIES COMPILE_OPTIONS -Wno-c2y-extensions)
    endif()
endfunction()
