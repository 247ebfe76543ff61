# Runs at build time: -DPROGRAM=jostle -DIN=jostle.1.in -DOUT=jostle.1 puts the list of programs into jostle(1).
execute_process(COMMAND ${PROGRAM} --man OUTPUT_VARIABLE programs COMMAND_ERROR_IS_FATAL ANY)
configure_file(${IN} ${OUT} @ONLY)
