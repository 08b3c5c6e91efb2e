# The object files carry the tasks, so that the bare loop runs on the very model.
dreamsearch_add_benchmark(env_dmc_benchmark
  SOURCES env_dmc_benchmark.cc $<TARGET_OBJECTS:env_dmc_tasks>
  LINK env_dmc_tasks)
