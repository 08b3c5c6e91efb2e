dreamsearch_add_benchmark(planner_benchmark SOURCES planner_benchmark.cc LINK ${CMAKE_DL_LIBS})
target_include_directories(planner_benchmark PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/..)
add_dependencies(planner_benchmark planner_dreamer planner_rollout planner_mcts planner_shooting)

find_package(Eigen3 REQUIRED)
dreamsearch_add_benchmark(planner_latency
  SOURCES planner_latency.cc LINK ${CMAKE_DL_LIBS} Eigen3::Eigen dreamsearch_native)
# GCC 12 sees an uninitialised operand in its own AVX-512 intrinsics (bug 105593).
target_compile_options(planner_latency PRIVATE -Wno-maybe-uninitialized -Wno-uninitialized)
target_include_directories(planner_latency PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/..)
add_dependencies(planner_latency planner_dreamer planner_rollout planner_mcts planner_shooting
                 model_dreamer env_dmc)
