# jostle_unit_test(NAME SOURCES … LINK …): one executable of GoogleTests, which
# ctest knows as unit.NAME with the label `quick`.
function(jostle_unit_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(jostle_unit_${name} ${ARG_SOURCES})
  target_link_libraries(jostle_unit_${name} PRIVATE jostle_flags ${ARG_LINK} GTest::gmock GTest::gtest_main)
  add_test(NAME unit.${name} COMMAND jostle_unit_${name})
  set_tests_properties(unit.${name} PROPERTIES LABELS "quick;unit" TIMEOUT 60)
endfunction()
