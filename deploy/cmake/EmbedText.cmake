# Text files as C++: at build time, so that a changed file is embedded anew.

# jostle_embed_text(OUTPUT NAME FILES…): a source in the build tree with
#   extern const std::span<const std::pair<std::string_view, std::string_view>> NAME
# of file names and contents, in namespace jostle::embedded: there before anything is initialized.
function(jostle_embed_text output name)
  add_custom_command(
    OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -D OUTPUT=${output} -D NAME=${name} -D "FILES=${ARGN}"
      -P ${CMAKE_SOURCE_DIR}/deploy/cmake/EmbedText.cmake
    DEPENDS ${ARGN} ${CMAKE_SOURCE_DIR}/deploy/cmake/EmbedText.cmake
    VERBATIM)
endfunction()

# As a script: writes the source.
if(CMAKE_SCRIPT_MODE_FILE)
  set(text "#include <span>\n#include <string_view>\n#include <utility>\n\nnamespace jostle::embedded {\n\n")
  string(APPEND text "using File = std::pair<std::string_view, std::string_view>;\nstatic constexpr File kFiles[]{\n")
  foreach(file IN LISTS FILES)
    get_filename_component(file_name ${file} NAME)
    file(READ ${file} content)
    string(APPEND text "{\"${file_name}\", R\"---(${content})---\"},\n")
  endforeach()
  string(APPEND text "};\nextern const std::span<const File> ${NAME};\nconstinit const std::span<const File> ${NAME}{kFiles};\n\n}  // namespace jostle::embedded\n")
  file(WRITE ${OUTPUT} "${text}")
endif()
