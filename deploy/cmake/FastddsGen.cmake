# Wire types from IDL, generated into the build tree.

find_program(FASTDDSGEN fastddsgen REQUIRED)

# jostle_idl_library(NAME DIRECTORY dir FILES a.idl b.idl …): jostle_NAME, alias
# jostle::NAME. Headers land in <build>/generated/<dir>, so a user writes
# #include "<dir>/aPubSubTypes.h".
#
#   -cs         names are case sensitive: std_msgs::msg::String is no keyword
#   -typeros2   type names as ROS 2 mangles them: pkg::msg::dds_::Name_
#
# The generator flattens includes and rewrites included files, so all IDL lies
# in one directory and one call makes everything.
function(jostle_idl_library name)
  cmake_parse_arguments(ARG "" "DIRECTORY" "FILES" ${ARGN})
  set(source_dir ${CMAKE_SOURCE_DIR}/${ARG_DIRECTORY})
  set(output_dir ${CMAKE_BINARY_DIR}/generated/${ARG_DIRECTORY})
  file(MAKE_DIRECTORY ${output_dir})
  set(outputs "")
  foreach(file IN LISTS ARG_FILES)
    get_filename_component(stem ${file} NAME_WE)
    list(APPEND outputs ${output_dir}/${stem}.h ${output_dir}/${stem}.cxx
                        ${output_dir}/${stem}PubSubTypes.h ${output_dir}/${stem}PubSubTypes.cxx)
  endforeach()
  list(TRANSFORM ARG_FILES PREPEND ${source_dir}/ OUTPUT_VARIABLE inputs)
  add_custom_command(
    OUTPUT ${outputs}
    COMMAND ${FASTDDSGEN} -cs -typeros2 -replace -d ${output_dir} ${ARG_FILES} > ${output_dir}/fastddsgen.log
    WORKING_DIRECTORY ${source_dir}
    DEPENDS ${inputs}
    COMMENT "Generating wire types of ${ARG_DIRECTORY}"
    VERBATIM)
  add_library(jostle_${name} STATIC ${outputs})
  add_library(jostle::${name} ALIAS jostle_${name})
  target_compile_options(jostle_${name} PRIVATE -w)  # not our code
  target_include_directories(jostle_${name} SYSTEM PUBLIC ${CMAKE_BINARY_DIR}/generated)
  target_link_libraries(jostle_${name} PUBLIC fastrtps fastcdr)
endfunction()
