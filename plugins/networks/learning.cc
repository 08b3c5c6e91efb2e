#include "plugins/networks/learning.h"

#include <cmath>
#include <string>

namespace dreamsearch::networks {
namespace {

// The value at the given fraction of the sorted order, between two linearly.
template <typename T>
double Percentile(std::vector<T>* values, double fraction) {
  const double position = fraction * static_cast<double>(values->size() - 1);
  const auto low = static_cast<std::ptrdiff_t>(position);
  std::nth_element(values->begin(), values->begin() + low, values->end());
  const auto below = static_cast<double>((*values)[static_cast<std::size_t>(low)]);
  if (static_cast<std::size_t>(low) + 1 >= values->size()) return below;
  const auto above =
      static_cast<double>(*std::min_element(values->begin() + low + 1, values->end()));
  return below + (position - static_cast<double>(low)) * (above - below);
}

}  // namespace

Status CheckSequences(const SequenceBatch& batch, Index observations, Index actions) {
  const std::uint64_t rows = batch.sequences * batch.length;
  const auto o = static_cast<std::uint64_t>(observations);
  const auto a = static_cast<std::uint64_t>(actions);
  if (rows == 0 || batch.observations.rows != rows || batch.observations.cols != o ||
      batch.actions.rows != rows || batch.actions.cols != a || batch.rewards.size != rows ||
      batch.discounts.size != rows || batch.is_first.size != rows) {
    return Error(StatusCode::kInvalidArgument,
                 "expected a batch of %llu sequences of %llu steps with %llu observations and %llu "
                 "actions, found views of %llu x %llu, %llu x %llu, %llu, %llu and %llu",
                 static_cast<unsigned long long>(batch.sequences),
                 static_cast<unsigned long long>(batch.length), static_cast<unsigned long long>(o),
                 static_cast<unsigned long long>(a),
                 static_cast<unsigned long long>(batch.observations.rows),
                 static_cast<unsigned long long>(batch.observations.cols),
                 static_cast<unsigned long long>(batch.actions.rows),
                 static_cast<unsigned long long>(batch.actions.cols),
                 static_cast<unsigned long long>(batch.rewards.size),
                 static_cast<unsigned long long>(batch.discounts.size),
                 static_cast<unsigned long long>(batch.is_first.size));
  }
  const std::uint64_t searches = batch.search_candidates == 0 ? 0 : rows;
  const std::uint64_t candidates = rows * batch.search_candidates;
  if (batch.search_actions.rows != candidates || (searches > 0 && batch.search_actions.cols != a) ||
      batch.search_weights.size != candidates || batch.search_values.size != searches) {
    return Error(StatusCode::kInvalidArgument,
                 "searches of %llu rows with %llu candidates expected; found views of %llu x %llu, "
                 "%llu and %llu",
                 static_cast<unsigned long long>(searches),
                 static_cast<unsigned long long>(batch.search_candidates),
                 static_cast<unsigned long long>(batch.search_actions.rows),
                 static_cast<unsigned long long>(batch.search_actions.cols),
                 static_cast<unsigned long long>(batch.search_weights.size),
                 static_cast<unsigned long long>(batch.search_values.size));
  }
  return OkStatus();
}

void ObservationStatistics::Include(const ObservationStatistics& before,
                                    MatrixView<const float> observations) {
  batches = before.batches + 1;
  const double rate = 1.0 / static_cast<double>(batches);
  const auto n = static_cast<double>(observations.rows);
  const std::uint64_t o = observations.cols;
  for (std::uint64_t i = 0; i < o; ++i) {
    double sum = 0;
    for (std::uint64_t j = 0; j < observations.rows; ++j) {
      sum += static_cast<double>(observations.data[j * o + i]);
    }
    const double batch_mean = sum / n;
    double squares = 0;
    for (std::uint64_t j = 0; j < observations.rows; ++j) {
      const double d = static_cast<double>(observations.data[j * o + i]) - batch_mean;
      squares += d * d;
    }
    const double shift = batch_mean - before.mean[i];
    mean[i] = before.mean[i] + rate * shift;
    variance[i] = (1 - rate) * (before.variance[i] + rate * shift * shift) + rate * squares / n;
  }
}

Status ObservationStatistics::Write(ByteSink* sink) const {
  const auto o = static_cast<Index>(mean.size());
  const Status status = WriteArray(sink, mean.data(), o);
  return status.ok() ? WriteArray(sink, variance.data(), o) : status;
}

Status ObservationStatistics::Read(ByteSource* source) {
  const auto o = static_cast<Index>(mean.size());
  const Status status = ReadArray(source, mean.data(), o);
  return status.ok() ? ReadArray(source, variance.data(), o) : status;
}

Status ObservationStatistics::Export(TensorSink* sink) const {
  const std::uint64_t shape[] = {mean.size()};
  const std::vector<float> means(mean.begin(), mean.end());
  const std::vector<float> variances(variance.begin(), variance.end());
  const Status status =
      sink->Tensor("observation_statistics.mean", {shape, 1}, {means.data(), means.size()});
  if (!status.ok()) return status;
  return sink->Tensor("observation_statistics.variance", {shape, 1},
                      {variances.data(), variances.size()});
}

template <typename T>
void PercentileScale::Include(std::vector<T>* returns, double rate, bool first) {
  const double low = Percentile(returns, 0.05);
  const double found = Percentile(returns, 0.95) - low;
  range = first ? found : range + rate * (found - range);
}

template <typename T>
void MoveGroup(const AdamSettings& adam, double learning_rate, double norm, std::uint64_t step,
               ParameterGroup<T>* group) {
  AdamStep move;
  move.learning_rate = learning_rate;
  move.beta1 = adam.beta1;
  move.beta2 = adam.beta2;
  move.epsilon = adam.epsilon;
  move.factor = norm > adam.gradient_clip ? adam.gradient_clip / norm : 1.0;
  move.rate1 = 1 / (1 - std::pow(adam.beta1, static_cast<double>(step)));
  move.rate2 = 1 / (1 - std::pow(adam.beta2, static_cast<double>(step)));
  ApplyAdam(move, group->size(), group->gradient(), group->first(), group->second(),
            group->values());
}

template <typename T>
void SlowCopy<T>::Allocate(const ParameterGroup<T>& group, bool rounded) {
  packed_ = std::make_unique<PackedWeights<T>>(group.parts());
  if (rounded) rounded_ = std::make_unique<Bfloat16Weights>(group.parts());
}

template <typename T>
void SlowCopy<T>::Reset(const ParameterGroup<T>& group) {
  values_.reserve(static_cast<std::size_t>(group.size() + kBiasOverrun));
  values_.assign(group.values(), group.values() + group.size());
}

template <typename T>
void SlowCopy<T>::Pack() {
  if (packed_ != nullptr) packed_->Pack(values_.data());
  if constexpr (std::is_same_v<T, float>) {
    if (rounded_ != nullptr) rounded_->Pack(values_.data());
  }
}

template <typename T>
std::vector<std::uint64_t> LearnerState<T>::Header() const {
  std::vector<std::uint64_t> numbers = {mark, sizeof(T), static_cast<std::uint64_t>(observations),
                                        static_cast<std::uint64_t>(actions)};
  std::uint64_t hash = 0xcbf29ce484222325ull;  // FNV-1a
  const auto add = [&hash](std::uint64_t value) { hash = (hash ^ value) * 0x100000001b3ull; };
  for (const ParameterGroup<T>* group : groups) {
    numbers.push_back(static_cast<std::uint64_t>(group->size()));
    for (const Tensor& tensor : group->tensors()) {
      for (const char c : tensor.name) add(static_cast<unsigned char>(c));
      add(static_cast<std::uint64_t>(tensor.rows));
      add(static_cast<std::uint64_t>(tensor.cols));
    }
  }
  if (acting != nullptr) add(1);
  numbers.push_back(hash);
  return numbers;
}

template <typename T>
Status LearnerState<T>::Save(ByteSink* sink) const {
  const std::vector<std::uint64_t> header = Header();
  Status status = WriteArray(sink, header.data(), static_cast<Index>(header.size()));
  for (const std::uint64_t* counter : counters) {
    if (status.ok()) status = WriteValue(sink, *counter);
  }
  if (status.ok()) status = WriteValue(sink, statistics->batches);
  if (status.ok()) status = WriteValue(sink, return_scale->range);
  if (status.ok()) status = statistics->Write(sink);
  for (const ParameterGroup<T>* group : groups) {
    for (const T* array : {group->values(), group->first(), group->second()}) {
      if (status.ok()) status = WriteArray(sink, array, group->size());
    }
  }
  for (const std::vector<T>* copy : {slow, acting}) {
    if (copy == nullptr || !status.ok()) continue;
    status = WriteArray(sink, copy->data(), static_cast<Index>(copy->size()));
  }
  return status;
}

template <typename T>
Status LearnerState<T>::Load(const char* model, ByteSource* source) const {
  const std::vector<std::uint64_t> expected = Header();
  std::vector<std::uint64_t> found(expected.size());
  Status status = ReadArray(source, found.data(), static_cast<Index>(found.size()));
  if (!status.ok()) return status;
  std::vector<std::string> names = {"mark", "bytes a number", "observation size", "action size"};
  for (const ParameterGroup<T>* group : groups) names.push_back(group->name() + " size");
  names.emplace_back("architecture");
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (found[i] == expected[i]) continue;
    return Error(StatusCode::kDataLoss, "saved %s: expected %s %llu, found %llu", model,
                 names[i].c_str(), static_cast<unsigned long long>(expected[i]),
                 static_cast<unsigned long long>(found[i]));
  }
  for (std::uint64_t* counter : counters) {
    if (status.ok()) status = ReadValue(source, counter);
  }
  if (status.ok()) status = ReadValue(source, &statistics->batches);
  if (status.ok()) status = ReadValue(source, &return_scale->range);
  if (status.ok()) status = statistics->Read(source);
  for (ParameterGroup<T>* group : groups) {
    for (T* array : {group->values(), group->first(), group->second()}) {
      if (status.ok()) status = ReadArray(source, array, group->size());
    }
  }
  for (std::vector<T>* copy : {slow, acting}) {
    if (copy == nullptr || !status.ok()) continue;
    status = ReadArray(source, copy->data(), static_cast<Index>(copy->size()));
  }
  return status;
}

template <typename T>
Status LearnerState<T>::Export(TensorSink* sink) const {
  std::vector<float> rows;
  const auto write = [&](const ParameterGroup<T>& group, const T* base, const std::string& prefix) {
    for (const Tensor& tensor : group.tensors()) {
      rows.resize(static_cast<std::size_t>(tensor.rows * tensor.cols));
      const Mat<const T> values(base + tensor.offset, tensor.rows, tensor.cols);
      for (Index i = 0; i < tensor.rows; ++i) {
        for (Index j = 0; j < tensor.cols; ++j) {
          rows[static_cast<std::size_t>(i * tensor.cols + j)] = static_cast<float>(values(i, j));
        }
      }
      const std::uint64_t shape[] = {static_cast<std::uint64_t>(tensor.rows),
                                     static_cast<std::uint64_t>(tensor.cols)};
      const bool vector = tensor.cols == 1 && !tensor.name.ends_with(".weight");
      const Status status = sink->Tensor((prefix + tensor.name).c_str(), {shape, vector ? 1u : 2u},
                                         {rows.data(), rows.size()});
      if (!status.ok()) return status;
    }
    return OkStatus();
  };
  for (const ParameterGroup<T>* group : groups) {
    if (const Status status = write(*group, group->values(), ""); !status.ok()) return status;
  }
  if (acting != nullptr) {
    const Status status = write(*acting_group, acting->data(), "acting_");
    if (!status.ok()) return status;
  }
  return statistics->Export(sink);
}

#define DREAMSEARCH_INSTANTIATE(T)                                               \
  template void PercentileScale::Include<T>(std::vector<T>*, double, bool);      \
  template void MoveGroup<T>(const AdamSettings&, double, double, std::uint64_t, \
                             ParameterGroup<T>*);                                \
  template class SlowCopy<T>;                                                    \
  template struct LearnerState<T>;
DREAMSEARCH_INSTANTIATE(float)
DREAMSEARCH_INSTANTIATE(double)
#undef DREAMSEARCH_INSTANTIATE

}  // namespace dreamsearch::networks
