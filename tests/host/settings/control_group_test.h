// control_group_test.h - a folder that stands for the files of the system's control groups.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "results/system/temporary_folder.h"

namespace dreamsearch {

class ControlGroupTest : public testing::Test {
 protected:
  std::filesystem::path Write(const std::filesystem::path& file, const std::string& text) const {
    std::filesystem::create_directories((folder_ / file).parent_path());
    std::ofstream(folder_ / file) << text;
    return folder_ / file;
  }

  TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
};

}  // namespace dreamsearch
