# What the libraries reach on this processor, for the yardstick and side by side with our
# products: Eigen as the runner has it, and oneDNN and libxsmm where they are installed.
add_library(dreamsearch_yardstick STATIC yardstick.cc)
target_include_directories(dreamsearch_yardstick PUBLIC ${PROJECT_SOURCE_DIR})
target_link_libraries(dreamsearch_yardstick PUBLIC dreamsearch::sdk
                      PRIVATE dreamsearch_eigen_product dreamsearch_flags)
# Debian's CMake package of oneDNN asks for OpenCL, which we do not need.
find_library(DREAMSEARCH_ONEDNN dnnl NO_CACHE)
find_path(DREAMSEARCH_ONEDNN_INCLUDE oneapi/dnnl/dnnl.h NO_CACHE)
if(DREAMSEARCH_ONEDNN AND DREAMSEARCH_ONEDNN_INCLUDE)
  target_link_libraries(dreamsearch_yardstick PRIVATE ${DREAMSEARCH_ONEDNN})
  target_compile_definitions(dreamsearch_yardstick PRIVATE DREAMSEARCH_HAVE_ONEDNN)
endif()
find_library(DREAMSEARCH_LIBXSMM xsmm NO_CACHE)
find_library(DREAMSEARCH_LIBXSMM_NOBLAS xsmmnoblas NO_CACHE)
find_path(DREAMSEARCH_LIBXSMM_INCLUDE libxsmm.h PATH_SUFFIXES libxsmm NO_CACHE)
if(DREAMSEARCH_LIBXSMM AND DREAMSEARCH_LIBXSMM_NOBLAS AND DREAMSEARCH_LIBXSMM_INCLUDE)
  target_link_libraries(dreamsearch_yardstick PRIVATE
    ${DREAMSEARCH_LIBXSMM} ${DREAMSEARCH_LIBXSMM_NOBLAS} ${CMAKE_DL_LIBS})
  target_include_directories(dreamsearch_yardstick SYSTEM PRIVATE ${DREAMSEARCH_LIBXSMM_INCLUDE})
  target_compile_definitions(dreamsearch_yardstick PRIVATE DREAMSEARCH_HAVE_LIBXSMM)
endif()

dreamsearch_add_benchmark(products_benchmark
  SOURCES products_benchmark.cc LINK dreamsearch_networks dreamsearch_yardstick)

dreamsearch_add_benchmark(model_dreamer_benchmark
  SOURCES model_dreamer_benchmark.cc LINK dreamer_model dreamsearch_yardstick)

dreamsearch_add_benchmark(model_tdmpc_benchmark
  SOURCES model_tdmpc_benchmark.cc LINK tdmpc_model dreamsearch_yardstick)
