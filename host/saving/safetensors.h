// safetensors.h - named float arrays in a file that other programs read.
//
// The safetensors format: 8 bytes, little-endian, the length of a JSON header; the
// header, which says for every array its type, shape and place in what follows; then
// the arrays, one after the other without gaps, row-major, float32. The header ends
// in spaces so that the arrays begin at a multiple of 64 bytes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "dreamsearch/stream.h"

namespace dreamsearch {

struct NamedTensor {
  std::string name;
  std::vector<std::uint64_t> shape;  // slowest first; empty for a single number
  std::vector<float> values;
};

// Keeps what a model exports. A tensor whose shape is not its size, or whose name is
// empty, taken or "__metadata__", is kInvalidArgument and not kept.
class TensorCollector final : public TensorSink {
 public:
  Status Tensor(const char* name, View<const std::uint64_t> shape,
                View<const float> values) noexcept override;

  const std::vector<NamedTensor>& tensors() const { return tensors_; }

 private:
  std::vector<NamedTensor> tensors_;
};

// Writes the file as OutputFile does. `metadata` becomes the header's
// __metadata__. Returns its size in bytes.
std::uint64_t WriteSafetensors(const std::filesystem::path& path,
                               const std::vector<NamedTensor>& tensors,
                               const std::map<std::string, std::string>& metadata);

}  // namespace dreamsearch
