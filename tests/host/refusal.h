// refusal.h - what an action that must fail said.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "results/system/error.h"
#include "results/text/names.h"

namespace dreamsearch {

inline void ExpectRefusal(const std::function<void()>& action, ExitCode code,
                          const std::vector<std::string>& parts) {
  try {
    action();
    ADD_FAILURE() << "nothing was refused; expected: " << JoinNames(parts);
  } catch (const Failure& error) {
    const std::string message = error.what();
    EXPECT_EQ(error.code(), code) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << "more than one line: " << message;
    for (const std::string& part : parts) {
      EXPECT_NE(message.find(part), std::string::npos)
          << "expected '" << part << "' in: " << message;
    }
  }
}

}  // namespace dreamsearch
