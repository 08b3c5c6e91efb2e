#include "host/settings/named_file.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "host/settings/parameter_text.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/sha256.h"

namespace dreamsearch {
namespace {

bool IsPath(const ParameterInfo& parameter, const std::string& text) {
  return !text.empty() && (parameter.choices.empty() ||
                           std::any_of(parameter.choices.begin(), parameter.choices.end(),
                                       [&](const auto& ending) { return text.ends_with(ending); }));
}

}  // namespace

void TakeFile(const ParameterInfo& parameter, const Setting& setting, ResolvedValue* value) {
  value->sha256.clear();
  if (!IsPath(parameter, value->choice)) return;
  const std::filesystem::path path =
      std::filesystem::path(AbsolutePath((setting.folder / value->choice).string()))
          .lexically_normal();
  const auto refuse = [&](const std::string& found) {
    throw Failure(ExitCode::kNotFound, setting.where + ": " + setting.key +
                                           ": expected a file, found " + found + ": " +
                                           path.string());
  };
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (status.type() == std::filesystem::file_type::not_found) refuse("nothing");
  if (error) refuse("one that cannot be read (" + error.message() + ")");
  if (std::filesystem::is_directory(status)) refuse("a folder");
  if (!std::filesystem::is_regular_file(status)) refuse("what is no regular file");
  try {
    value->sha256 = Sha256HexOfFile(path);
  } catch (const Failure& failure) {
    refuse(std::string("one that cannot be read (") + failure.what() + ")");
  }
  value->choice = path.string();
}

}  // namespace dreamsearch
