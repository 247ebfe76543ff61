# The commit that is built as C++: asked for at every build, written when it is another.

# jostle_commit(OUTPUT): a source with jostle::common::kCommit, "unknown" outside of a repository.
function(jostle_commit output)
  add_custom_target(jostle_commit BYPRODUCTS ${output}
    COMMAND ${CMAKE_COMMAND} -D OUTPUT=${output} -D SOURCES=${CMAKE_SOURCE_DIR}
      -P ${CMAKE_SOURCE_DIR}/deploy/cmake/Commit.cmake
    VERBATIM)
endfunction()

if(CMAKE_SCRIPT_MODE_FILE)
  execute_process(COMMAND git -C ${SOURCES} describe --always --dirty --abbrev=12 --exclude=*
    OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
  if(failed)
    set(commit unknown)
  endif()
  set(text "namespace jostle::common {\nextern const char* const kCommit;\nconst char* const kCommit = \"${commit}\";\n}\n")
  if(EXISTS ${OUTPUT})
    file(READ ${OUTPUT} before)
  endif()
  if(NOT "${before}" STREQUAL "${text}")
    file(WRITE ${OUTPUT} "${text}")
  endif()
endif()
