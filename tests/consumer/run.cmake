# Installs a build into a prefix of its own, then configures, builds and runs the foreign project against it.
#   cmake -DBUILD=... -DSOURCE=... -DWORK=... -DGENERATOR=... -DC_COMPILER=... -DCXX_COMPILER=... -DFLAGS=... -P run.cmake
cmake_minimum_required(VERSION 3.25)

function(run)
    execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
    if(NOT result EQUAL 0)
        message(FATAL_ERROR "failed (${result}): ${ARGN}\n${output}")
    endif()
    set(output "${output}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE "${WORK}")
run(${CMAKE_COMMAND} --install "${BUILD}" --prefix "${WORK}/prefix")
run(${CMAKE_COMMAND} -S "${SOURCE}" -B "${WORK}/build" -G "${GENERATOR}"
    "-DCMAKE_PREFIX_PATH=${WORK}/prefix" "-DCMAKE_BUILD_TYPE=Release"
    "-DCMAKE_C_COMPILER=${C_COMPILER}" "-DCMAKE_CXX_COMPILER=${CXX_COMPILER}"
    "-DCMAKE_C_FLAGS=${FLAGS}" "-DCMAKE_CXX_FLAGS=${FLAGS}")
run(${CMAKE_COMMAND} --build "${WORK}/build")
run("${WORK}/build/listener" "${WORK}/build/simulator")
message(STATUS "${output}")
run("${WORK}/build/everything")

# What is installed must not point back to where it was built.
file(GLOB_RECURSE exported "${WORK}/prefix/*.cmake")
foreach(file IN LISTS exported)
    file(READ "${file}" content)
    if(content MATCHES "haptic_options|tomlplusplus" OR content MATCHES "${BUILD}")
        message(FATAL_ERROR "${file} refers to something that only the build has: ${CMAKE_MATCH_0}")
    endif()
endforeach()
file(REMOVE_RECURSE "${WORK}")
