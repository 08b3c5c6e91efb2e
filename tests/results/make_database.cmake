# Makes the database of the comparison check anew.
file(REMOVE ${DATABASE} ${DATABASE}-wal ${DATABASE}-shm)
execute_process(COMMAND ${PROGRAM} ${DATABASE} 5 3 5 20000 COMMAND_ERROR_IS_FATAL ANY)
