# Targets of one room, with the flags that every one of them shares.

add_library(jostle_flags INTERFACE)
target_compile_options(jostle_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wno-missing-field-initializers)
target_include_directories(jostle_flags INTERFACE ${CMAKE_SOURCE_DIR})

# jostle_library(NAME SOURCES … [PUBLIC …] [PRIVATE …]): jostle_NAME, alias jostle::NAME.
function(jostle_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(jostle_${name} STATIC ${ARG_SOURCES})
  add_library(jostle::${name} ALIAS jostle_${name})
  target_link_libraries(jostle_${name} PUBLIC jostle_flags ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
endfunction()

# The same for a room that has only headers.
function(jostle_interface name)
  add_library(jostle_${name} INTERFACE)
  add_library(jostle::${name} ALIAS jostle_${name})
  target_link_libraries(jostle_${name} INTERFACE jostle_flags ${ARGN})
endfunction()

# All programs, without the tests.
add_custom_target(programs)

# jostle_program(NAME SOURCES … LINK … [COMPONENT …] [INTERNAL]): build/bin/jostle_NAME. It is
# installed beside the launcher, in the package of COMPONENT (jostle, see deploy/). INTERNAL: another program starts it,
# and no user does.
function(jostle_program name)
  cmake_parse_arguments(ARG "INTERNAL" "COMPONENT" "SOURCES;LINK" ${ARGN})
  add_executable(jostle_${name} ${ARG_SOURCES})
  target_link_libraries(jostle_${name} PRIVATE jostle_flags ${ARG_LINK})
  add_dependencies(programs jostle_${name})
  if(NOT ARG_COMPONENT)
    set(ARG_COMPONENT jostle)
  endif()
  install(TARGETS jostle_${name} DESTINATION ${JOSTLE_PROGRAMS} COMPONENT ${ARG_COMPONENT})
  if(NOT ARG_INTERNAL)
    set_property(GLOBAL APPEND PROPERTY JOSTLE_${ARG_COMPONENT}_PROGRAMS ${name})  # deploy/ makes their manual pages
  endif()
endfunction()
