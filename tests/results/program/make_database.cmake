# Makes the database of the comparison check anew.
file(REMOVE ${DATABASE} ${DATABASE}-wal ${DATABASE}-shm)
execute_process(COMMAND ${PROGRAM} ${DATABASE} 3 3 5 10000 decisions COMMAND_ERROR_IS_FATAL ANY)
