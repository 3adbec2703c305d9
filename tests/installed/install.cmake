# Installs the library and what programs are built with, and checks that nothing of it refers to where it was built.
#   cmake -DBUILD=... -DSOURCE=... -DPREFIX=... -P install.cmake
cmake_minimum_required(VERSION 3.25)

file(REMOVE_RECURSE "${PREFIX}")
foreach(component IN ITEMS lib dev)
    execute_process(COMMAND ${CMAKE_COMMAND} --install "${BUILD}" --component ${component} --prefix "${PREFIX}"
                    OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
endforeach()

file(GLOB_RECURSE described "${PREFIX}/*.cmake" "${PREFIX}/*.pc" "${PREFIX}/*.h")
list(LENGTH described count)
if(count LESS 7)
    message(FATAL_ERROR "only these were installed: ${described}")
endif()
foreach(file IN LISTS described)
    file(READ "${file}" content)
    foreach(place IN ITEMS "${BUILD}" "${SOURCE}" "${PREFIX}" haptic_options haptic_ring glm)
        string(FIND "${content}" "${place}" found)
        if(NOT found EQUAL -1)
            message(FATAL_ERROR "${file} refers to ${place}, which only the build has")
        endif()
    endforeach()
endforeach()
