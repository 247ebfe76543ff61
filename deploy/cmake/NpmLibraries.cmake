# jostle_npm_libraries(READY WHAT SECONDS): npm's libraries of the calling folder's package-lock.json, into the build tree.
# They are fetched, within SECONDS, when they are not there yet or the lock has changed: that needs a registry. READY says
# whether they lie there; where not, a status line says that WHAT is not built, and why.
function(jostle_npm_libraries ready what seconds)
  set(${ready} FALSE PARENT_SCOPE)
  find_program(JOSTLE_NODE node)
  find_program(JOSTLE_NPM npm)
  if(NOT JOSTLE_NODE OR NOT JOSTLE_NPM)
    message(STATUS "${what} is not built: it needs Node.js and npm")
    return()
  endif()
  foreach(file package.json package-lock.json)
    configure_file(${file} ${file} COPYONLY)
  endforeach()
  file(SHA256 ${CMAKE_CURRENT_SOURCE_DIR}/package-lock.json wanted)
  set(stamp ${CMAKE_CURRENT_BINARY_DIR}/node_modules/jostle.stamp)
  set(installed "")
  if(EXISTS ${stamp})
    file(READ ${stamp} installed)
  endif()
  if(NOT installed STREQUAL wanted)
    execute_process(
      COMMAND ${JOSTLE_NPM} ci --ignore-scripts --no-audit --no-fund --fetch-retries=1 --fetch-timeout=20000
      WORKING_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}
      TIMEOUT ${seconds} RESULT_VARIABLE failed OUTPUT_QUIET ERROR_VARIABLE problem)
    if(NOT failed EQUAL 0)
      message(STATUS "${what} is not built: npm has no registry, or not these packages")
      return()
    endif()
    file(WRITE ${stamp} ${wanted})
  endif()
  set(${ready} TRUE PARENT_SCOPE)
endfunction()
