// The test program describes plugins itself, as `runner` does.
#include <gtest/gtest.h>

#include <string_view>

#include "host/plugins/catalogue.h"

int main(int argc, char** argv) {
  if (argc == 3 && std::string_view(argv[1]) == "describe-plugin") {
    return dreamsearch::DescribePluginMain(argv[2]);
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
