# haptic_npm_packages(FOLDER FAILED): fetches the packages of package.json and package-lock.json of this directory to
# FOLDER/node_modules, when CMake configures and once for each lock file, so that a machine without the registry can build
# without them. FAILED is true if npm could not fetch them.
function(haptic_npm_packages folder failed)
    set(${failed} FALSE PARENT_SCOPE)
    file(SHA256 ${CMAKE_CURRENT_SOURCE_DIR}/package-lock.json lock)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS package-lock.json)
    set(fetched "")
    if(EXISTS ${folder}/fetched)
        file(READ ${folder}/fetched fetched)
    endif()
    if(fetched STREQUAL lock)
        return()
    endif()
    file(COPY package.json package-lock.json DESTINATION ${folder})
    execute_process(COMMAND ${HAPTIC_NPM} ci --omit=dev --ignore-scripts --prefer-offline --no-audit --no-fund
                    WORKING_DIRECTORY ${folder} RESULT_VARIABLE status OUTPUT_QUIET ERROR_VARIABLE complaint TIMEOUT 300)
    if(status)
        message(STATUS "npm ci in ${folder} failed: ${complaint}")
        set(${failed} TRUE PARENT_SCOPE)
        return()
    endif()
    file(WRITE ${folder}/fetched ${lock})
endfunction()
