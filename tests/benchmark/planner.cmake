dreamsearch_add_benchmark(planner_benchmark SOURCES planner_benchmark.cc LINK ${CMAKE_DL_LIBS})
add_dependencies(planner_benchmark planner_dreamer planner_rollout planner_mcts planner_shooting)

dreamsearch_add_benchmark(boundary_benchmark
  SOURCES boundary_benchmark.cc LINK ${CMAKE_DL_LIBS} dreamsearch_host)
add_dependencies(boundary_benchmark planner_dreamer planner_rollout planner_mcts planner_shooting)

dreamsearch_add_benchmark(planner_latency
  SOURCES planner_latency.cc LINK ${CMAKE_DL_LIBS} dreamsearch_host dreamsearch_yardstick)
add_dependencies(planner_latency planner_dreamer planner_rollout planner_mcts planner_shooting
                 model_dreamer env_dmc)
