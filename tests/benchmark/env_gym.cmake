dreamsearch_add_benchmark(bridge_benchmark SOURCES bridge_benchmark.cc LINK env_gym_bridge)
target_compile_definitions(bridge_benchmark PRIVATE
  DREAMSEARCH_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
