// model_bench.h - what the laws of model.h are tried with: models made as a host makes them, rows
// to ask about, sequences to train on.
#pragma once

#include <memory>
#include <vector>

#include "law.h"
#include "probe_environment.h"
#include "tools.h"

namespace dreamsearch::check {

// One row of a request: what decides its answers.
struct Row {
  std::vector<double> observation, action, next_action;
  std::vector<std::byte> state;  // of the environment; empty for a model that needs none
  std::uint64_t seed = 0;
};

// Sequences to train on, with memory of their own.
struct Batch {
  std::uint64_t sequences = 4, length = 12, candidates = 0;
  std::vector<float> observations, actions, rewards, discounts;
  std::vector<std::uint8_t> is_first;
  std::vector<float> search_actions, search_weights, search_values;

  Batch(const Sizes& sizes, bool searched, std::uint64_t seed);

  SequenceBatch View(const Sizes& sizes) const;
};

class ModelBench {
 public:
  explicit ModelBench(const Trial& trial)
      : trial_(trial), sizes_(trial.sizes()), environment_(sizes_.observation, sizes_.action) {}

  // A model for this trial; breaks a law if its sizes are not those it was made for.
  Owned<Model> Make(std::uint64_t seed = 1);

  std::vector<Row> Rows(std::uint64_t count, std::uint64_t seed);

  // Everything that can be asked about the rows in one request of each kind; a transcript for
  // each row. Breaks a law if a call fails; where `check` is set also if it leaves something unset,
  // out of range, or writes beside its views.
  std::vector<Transcript> Answers(Model* model, const std::vector<Row>& rows, bool check = false);

  // The latents of the rows' observations, at an episode's start.
  std::vector<std::byte> Observed(Model* model, const std::vector<Row>& rows);

  // The call, its allocations added to allocations().
  template <typename Call>
  Status Counted(Call call) {
    const std::uint64_t before = Allocations();
    const Status status = call();
    allocations_ += Allocations() - before;
    return status;
  }

  Transcript AllAnswers(Model* model, std::uint64_t seed) {
    return Joined(Answers(model, Rows(4, seed)));
  }
  static Transcript Joined(const std::vector<Transcript>& rows);

  Status Train(Model* model, const Batch& batch, std::uint64_t update,
               Transcript* transcript = nullptr, bool check = false);
  // Does nothing to a model that does not learn.
  void Learn(Model* model, std::uint64_t first, std::uint64_t count,
             Transcript* transcript = nullptr, bool check = false);

  static Bytes Save(const Model& model);

  std::uint64_t allocations() const { return allocations_; }
  const Sizes& sizes() const { return sizes_; }

 private:
  const Trial& trial_;
  const Sizes sizes_;
  ProbeEnvironment environment_;
  std::vector<std::unique_ptr<ProbeEnvironment>> environments_;
  std::uint64_t allocations_ = 0;
};

}  // namespace dreamsearch::check
