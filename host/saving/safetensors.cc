#include "host/saving/safetensors.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "results/system/file.h"
#include "results/text/json_text.h"
#include "results/text/table.h"

namespace dreamsearch {
namespace {

constexpr char kMetadata[] = "__metadata__";
constexpr std::uint64_t kDataAlignment = 64;

}  // namespace

Status TensorCollector::Tensor(const char* name, View<const std::uint64_t> shape,
                               View<const float> values) noexcept {
  try {
    NamedTensor tensor;
    tensor.name = name != nullptr ? name : "";
    std::uint64_t size = 1;
    for (const std::uint64_t extent : shape) {
      tensor.shape.push_back(extent);
      size *= extent;
    }
    const bool taken = std::any_of(tensors_.begin(), tensors_.end(),
                                   [&](const auto& known) { return known.name == tensor.name; });
    if (tensor.name.empty() || tensor.name == kMetadata || taken) {
      return Error(StatusCode::kInvalidArgument, "tensor name '%s' is empty, reserved or taken",
                   tensor.name.c_str());
    }
    if (size != values.size) {
      return Error(StatusCode::kInvalidArgument, "tensor '%s' has %llu values, its shape says %llu",
                   tensor.name.c_str(), static_cast<unsigned long long>(values.size),
                   static_cast<unsigned long long>(size));
    }
    tensor.values.assign(values.begin(), values.end());
    tensors_.push_back(std::move(tensor));
    return OkStatus();
  } catch (const std::exception& error) {
    return Error(StatusCode::kInternal, "cannot keep a tensor: %s", error.what());
  }
}

std::uint64_t WriteSafetensors(const std::filesystem::path& path,
                               const std::vector<NamedTensor>& tensors,
                               const std::map<std::string, std::string>& metadata) {
  nlohmann::json header;
  header[kMetadata] = metadata;
  std::uint64_t end = 0;
  for (const NamedTensor& tensor : tensors) {
    const std::uint64_t begin = end;
    end += tensor.values.size() * sizeof(float);
    header[tensor.name] = {
        {"dtype", "F32"}, {"shape", tensor.shape}, {"data_offsets", {begin, end}}};
  }
  std::string text = results::JsonText(header);
  while ((sizeof(std::uint64_t) + text.size()) % kDataAlignment != 0) text += ' ';
  const std::uint64_t length = text.size();
  std::string bytes(reinterpret_cast<const char*>(&length), sizeof length);
  bytes += text;
  for (const NamedTensor& tensor : tensors) {
    bytes.append(reinterpret_cast<const char*>(tensor.values.data()),
                 tensor.values.size() * sizeof(float));
  }
  WriteFile(path.string(), bytes);
  return bytes.size();
}

}  // namespace dreamsearch
