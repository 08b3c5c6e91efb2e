#include "model_bench.h"

#include <algorithm>
#include <limits>

#include "dreamsearch/random.h"

namespace dreamsearch::check {
namespace {

constexpr std::uint64_t kEach = 3;  // samples a latent

}  // namespace

Batch::Batch(const Sizes& sizes, bool searched, std::uint64_t seed) {
  const std::uint64_t rows = sequences * length;
  Random random(seed);
  observations.resize(rows * sizes.observation);
  actions.resize(rows * sizes.action);
  rewards.resize(rows);
  discounts.assign(rows, 1.0f);
  is_first.assign(rows, 0);
  for (float& x : observations) x = static_cast<float>(random.Uniform(-1, 1));
  for (float& x : actions) x = static_cast<float>(random.Uniform(-1, 1));
  for (float& x : rewards) x = static_cast<float>(random.Uniform(0, 1));
  for (std::uint64_t b = 0; b < sequences; ++b) is_first[b * length] = b % 2 == 0 ? 1 : 0;
  is_first[length / 2] = 1;  // an episode that runs on into another one
  for (std::uint64_t i = 0; i < rows; ++i) {
    if (is_first[i] == 0) continue;
    rewards[i] = 0;
    std::fill_n(&actions[i * sizes.action], sizes.action, 0.0f);
  }
  if (!searched) return;
  candidates = 2;
  search_actions.resize(rows * candidates * sizes.action);
  search_weights.assign(rows * candidates, 0.5f);
  search_values.assign(rows, 1.0f);
  for (float& x : search_actions) x = static_cast<float>(random.Uniform(-1, 1));
  std::fill_n(search_weights.begin(), candidates, 0.0f);  // a row that was not searched
}

SequenceBatch Batch::View(const Sizes& sizes) const {
  const std::uint64_t rows = sequences * length;
  SequenceBatch batch;
  batch.sequences = sequences;
  batch.length = length;
  batch.observations = {observations.data(), rows, sizes.observation};
  batch.actions = {actions.data(), rows, sizes.action};
  batch.rewards = {rewards.data(), rows};
  batch.discounts = {discounts.data(), rows};
  batch.is_first = {is_first.data(), rows};
  batch.search_candidates = candidates;
  batch.search_actions = {search_actions.data(), rows * candidates, sizes.action};
  batch.search_weights = {search_weights.data(), search_weights.size()};
  batch.search_values = {search_values.data(), search_values.size()};
  return batch;
}

Owned<Model> ModelBench::Make(std::uint64_t seed) {
  ModelContext context;
  context.parameters = trial_.parameters();
  context.observation_size = sizes_.observation;
  context.action_size = sizes_.action;
  context.action_repeat = 1;
  context.episode_decisions = ProbeEnvironment::kEpisodeSteps;
  context.terminates = false;
  context.seed = seed;
  if (trial_.Has(kNeedsEnvironment)) {
    // As the host does: an environment for each model, which outlives it.
    environments_.push_back(std::make_unique<ProbeEnvironment>(sizes_.observation, sizes_.action));
    context.environment = environments_.back().get();
  }
  NoteCall("the factory");
  Model* made = nullptr;
  const Status status = trial_.component().create_model(context, &made);
  Owned<Model> model = Take(status, made);
  NoteCall("latent_bytes");
  const std::uint64_t bytes = model->latent_bytes();
  Expect(bytes > 0 && bytes % kLatentAlignment == 0,
         Format("latent_bytes a multiple of %llu above 0",
                static_cast<unsigned long long>(kLatentAlignment)),
         std::to_string(bytes));
  Expect(model->action_size() == sizes_.action,
         "action_size the context's, " + std::to_string(sizes_.action),
         std::to_string(model->action_size()));
  NoteCall("SetThreads");
  model->SetThreads(1);
  return model;
}

std::vector<Row> ModelBench::Rows(std::uint64_t count, std::uint64_t seed) {
  std::vector<Row> rows(count);
  for (std::uint64_t i = 0; i < count; ++i) {
    Row& row = rows[i];
    Random random(DeriveSeed(seed, i));
    row.observation.resize(sizes_.observation);
    row.action.resize(sizes_.action);
    row.next_action.resize(sizes_.action);
    for (double& x : row.observation) x = random.Uniform(-1, 1);
    for (double& x : row.action) x = random.Uniform(-1, 1);
    for (double& x : row.next_action) x = random.Uniform(-1, 1);
    row.seed = random.Next();
    if (!trial_.Has(kNeedsEnvironment)) continue;
    const View<double> seen{row.observation.data(), row.observation.size()};
    ExpectOk(environment_.Reset(static_cast<std::uint32_t>(random.Next()), seen), "Reset");
    row.state.resize(environment_.state_bytes());
    ExpectOk(environment_.SaveState({row.state.data(), row.state.size()}), "SaveState");
  }
  return rows;
}

std::vector<Transcript> ModelBench::Answers(Model* model, const std::vector<Row>& rows,
                                            bool check) {
  const std::uint64_t n = rows.size(), bytes = model->latent_bytes();
  Guarded<std::byte> initial("the initial latents", n * bytes), observed("the latents", n * bytes),
      imagined("the imagined latents", n * bytes);
  Guarded<double> rewards("the rewards", n), discounts("the discounts", n), values("the values", n),
      spread_values("the values of Spread", n), deviations("the deviations", n),
      least("the least values", n), mode("the proposed actions", n * sizes_.action),
      samples("the sampled actions", n * kEach * sizes_.action);
  std::vector<std::uint64_t> seeds;
  std::vector<double> actions, next_actions, observations;
  std::vector<std::byte> states;
  for (const Row& row : rows) {
    seeds.push_back(row.seed);
    actions.insert(actions.end(), row.action.begin(), row.action.end());
    next_actions.insert(next_actions.end(), row.next_action.begin(), row.next_action.end());
    observations.insert(observations.end(), row.observation.begin(), row.observation.end());
    states.insert(states.end(), row.state.begin(), row.state.end());
  }
  const View<const std::uint64_t> seed_view{seeds.data(), n};

  allocations_ = 0;
  NoteCall("InitialLatent");
  ExpectOk(Counted([&] {
             return model->InitialLatent({initial.data(), n, bytes});
           }),
           "InitialLatent");
  ObserveRequest observe;
  observe.previous = {initial.data(), n, bytes};
  observe.actions = {actions.data(), n, sizes_.action};
  observe.observations = {observations.data(), n, sizes_.observation};
  if (!states.empty()) observe.environment_states = {states.data(), n, states.size() / n};
  observe.seeds = seed_view;
  NoteCall("Observe");
  ExpectOk(Counted([&] {
             return model->Observe(observe, {observed.data(), n, bytes});
           }),
           "Observe");
  ImagineRequest imagine;
  imagine.latents = {observed.data(), n, bytes};
  imagine.actions = {next_actions.data(), n, sizes_.action};
  imagine.seeds = seed_view;
  ImagineResult imagined_result;
  imagined_result.latents = {imagined.data(), n, bytes};
  imagined_result.rewards = rewards.view();
  imagined_result.discounts = discounts.view();
  const std::vector<std::byte> from(observed.data(), observed.data() + observed.size());
  NoteCall("Imagine");
  ExpectOk(Counted([&] { return model->Imagine(imagine, imagined_result); }), "Imagine");
  const ConstLatents asked{imagined.data(), n, bytes};
  NoteCall("Value");
  ExpectOk(Counted([&] { return model->Value(asked, values.view()); }), "Value");
  auto* spread = ExtensionOf<ValueSpread>(model);
  if (spread != nullptr) {
    SpreadResult room;
    room.values = spread_values.view();
    room.deviations = deviations.view();
    room.least = least.view();
    NoteCall("Spread");
    ExpectOk(Counted([&] { return spread->Spread(asked, room); }), "Spread");
  }
  NoteCall("ProposeMode");
  ExpectOk(Counted([&] {
             return model->ProposeMode(asked, {mode.data(), n, sizes_.action});
           }),
           "ProposeMode");
  NoteCall("ProposeSamples");
  ExpectOk(
      Counted([&] {
        return model->ProposeSamples(asked, seed_view, {samples.data(), n * kEach, sizes_.action});
      }),
      "ProposeSamples");

  if (check) {
    for (const Guarded<std::byte>* room : {&initial, &observed, &imagined}) room->CheckGuards();
    for (const Guarded<double>* room : {&rewards, &discounts, &values, &mode, &samples}) {
      room->CheckGuards();
      room->CheckSet();
    }
    if (spread != nullptr) {
      for (const Guarded<double>* room : {&spread_values, &deviations, &least}) {
        room->CheckGuards();
        room->CheckSet();
      }
      deviations.CheckRange(0, std::numeric_limits<double>::max());
      Expect(std::equal(values.view().begin(), values.view().end(), spread_values.data()),
             "the values of Spread to be those of Value, to the bit", "others");
    }
    Expect(std::equal(from.begin(), from.end(), observed.data()),
           "the latents that Imagine begins at unchanged", "bytes written to them");
    discounts.CheckRange(0, 1);
    mode.CheckRange(-1, 1);
    samples.CheckRange(-1, 1);
  }
  std::vector<Transcript> transcripts(n);
  for (std::uint64_t i = 0; i < n; ++i) {
    Transcript& row = transcripts[i];
    row.Add("reward", rewards[i]);
    row.Add("discount", discounts[i]);
    row.Add("value", values[i]);
    if (spread != nullptr) {
      row.Add("deviation", deviations[i]);
      row.Add("least value", least[i]);
    }
    row.Add("mode", mode.rows(n).row(i));
    row.Add("samples", View<const double>(samples.rows(n).row(i)));
    if (!check || spread == nullptr) continue;
    Expect(least[i] <= values[i] + 1e-6 * std::max(1.0, std::abs(values[i])),
           "a least value that is not above the value",
           Number(least[i]) + " above " + Number(values[i]));
  }
  return transcripts;
}

std::vector<std::byte> ModelBench::Observed(Model* model, const std::vector<Row>& rows) {
  const std::uint64_t n = rows.size(), bytes = model->latent_bytes();
  Guarded<std::byte> initial("the initial latents", n * bytes), observed("the latents", n * bytes);
  std::vector<std::uint64_t> seeds;
  std::vector<double> observations;
  std::vector<std::byte> states;
  for (const Row& row : rows) {
    seeds.push_back(row.seed);
    observations.insert(observations.end(), row.observation.begin(), row.observation.end());
    states.insert(states.end(), row.state.begin(), row.state.end());
  }
  const std::vector<double> actions(n * sizes_.action);
  NoteCall("InitialLatent");
  ExpectOk(model->InitialLatent({initial.data(), n, bytes}), "InitialLatent");
  ObserveRequest observe;
  observe.previous = {initial.data(), n, bytes};
  observe.actions = {actions.data(), n, sizes_.action};
  observe.observations = {observations.data(), n, sizes_.observation};
  if (!states.empty()) observe.environment_states = {states.data(), n, states.size() / n};
  observe.seeds = {seeds.data(), n};
  NoteCall("Observe");
  ExpectOk(model->Observe(observe, {observed.data(), n, bytes}), "Observe");
  return {observed.data(), observed.data() + observed.size()};
}

Transcript ModelBench::Joined(const std::vector<Transcript>& rows) {
  Transcript all;
  for (std::size_t i = 0; i < rows.size(); ++i)
    all.Append("row " + std::to_string(i) + ", ", rows[i]);
  return all;
}

Status ModelBench::Train(Model* model, const Batch& batch, std::uint64_t update,
                         Transcript* transcript, bool check) {
  Guarded<double> metrics("the metrics", trial_.component().metrics.size);
  const SequenceBatch sequences = batch.View(sizes_);
  TrainRequest request;
  request.batch = &sequences;
  request.seed = DeriveSeed(9, update);
  request.update = update;
  request.environment_step = 100 * update;
  NoteCall("Train, update " + std::to_string(update));
  const Status status = model->Train(request, metrics.view());
  if (!status.ok()) return status;
  if (check) {
    metrics.CheckGuards();
    metrics.CheckSet();
  }
  if (transcript != nullptr) {
    transcript->Add("update " + std::to_string(update) + ", metric", metrics.view());
  }
  return status;
}

void ModelBench::Learn(Model* model, std::uint64_t first, std::uint64_t count,
                       Transcript* transcript, bool check) {
  if (!trial_.Has(kLearns)) return;
  const Batch batch(sizes_, trial_.Has(kLearnsFromSearch), 5);
  for (std::uint64_t update = first; update < first + count; ++update) {
    ExpectOk(Train(model, batch, update, transcript, check), "Train");
  }
}

Bytes ModelBench::Save(const Model& model) {
  Bytes saved;
  NoteCall("Save");
  ExpectOk(model.Save(&saved), "Save");
  return saved;
}

}  // namespace dreamsearch::check
