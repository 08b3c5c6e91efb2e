find_package(Eigen3 3.4 REQUIRED NO_MODULE)
dreamsearch_add_benchmark(model_dreamer_benchmark
  SOURCES model_dreamer_benchmark.cc LINK dreamer_model dreamsearch_native)
get_target_property(eigen_includes Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
target_include_directories(model_dreamer_benchmark SYSTEM PRIVATE ${eigen_includes})
target_include_directories(model_dreamer_benchmark PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/../model_dreamer)
target_compile_options(model_dreamer_benchmark PRIVATE
  $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized -Wno-uninitialized>)
