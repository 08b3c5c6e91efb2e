// model_laws.cc - the laws of model.h, one function each. Over 400 lines: they share their
// subjects.
#include "dreamsearch/random.h"
#include "law.h"
#include "probe_environment.h"
#include "tools.h"

namespace dreamsearch::check {
namespace {

constexpr std::uint64_t kEach = 3;  // samples a latent

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

  Batch(const Sizes& sizes, bool searched, std::uint64_t seed) {
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

  SequenceBatch View(const Sizes& sizes) const {
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
};

class ModelBench {
 public:
  explicit ModelBench(const Trial& trial)
      : trial_(trial), sizes_(trial.sizes()), environment_(sizes_.observation, sizes_.action) {}

  Owned<Model> Make(std::uint64_t seed = 1) {
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
      environments_.push_back(
          std::make_unique<ProbeEnvironment>(sizes_.observation, sizes_.action));
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

  std::vector<Row> Rows(std::uint64_t count, std::uint64_t seed) {
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

  // Everything that can be asked about the rows in one request of each kind; a transcript for
  // each row. Breaks a law if a call fails; where `check` is set also if it leaves something unset,
  // out of range, or writes beside its views.
  std::vector<Transcript> Answers(Model* model, const std::vector<Row>& rows, bool check = false) {
    const std::uint64_t n = rows.size(), bytes = model->latent_bytes();
    Guarded<std::byte> initial("the initial latents", n * bytes),
        observed("the latents", n * bytes), imagined("the imagined latents", n * bytes);
    Guarded<double> rewards("the rewards", n), discounts("the discounts", n),
        values("the values", n), spread_values("the values of Spread", n),
        deviations("the deviations", n), least("the least values", n),
        mode("the proposed actions", n * sizes_.action),
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
    ExpectOk(Counted([&] {
               return model->ProposeSamples(asked, seed_view,
                                            {samples.data(), n * kEach, sizes_.action});
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

  // The latents of the rows' observations, at an episode's start.
  std::vector<std::byte> Observed(Model* model, const std::vector<Row>& rows) {
    const std::uint64_t n = rows.size(), bytes = model->latent_bytes();
    Guarded<std::byte> initial("the initial latents", n * bytes),
        observed("the latents", n * bytes);
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
               Transcript* transcript = nullptr, bool check = false) {
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
  // Does nothing to a model that does not learn.
  void Learn(Model* model, std::uint64_t first, std::uint64_t count,
             Transcript* transcript = nullptr, bool check = false) {
    if (!trial_.Has(kLearns)) return;
    const Batch batch(sizes_, trial_.Has(kLearnsFromSearch), 5);
    for (std::uint64_t update = first; update < first + count; ++update) {
      ExpectOk(Train(model, batch, update, transcript, check), "Train");
    }
  }

  static Bytes Save(const Model& model) {
    Bytes saved;
    NoteCall("Save");
    ExpectOk(model.Save(&saved), "Save");
    return saved;
  }

  std::uint64_t allocations() const { return allocations_; }
  const Sizes& sizes() const { return sizes_; }

 private:
  const Trial& trial_;
  const Sizes sizes_;
  ProbeEnvironment environment_;
  std::vector<std::unique_ptr<ProbeEnvironment>> environments_;
  std::uint64_t allocations_ = 0;
};

Transcript ModelBench::Joined(const std::vector<Transcript>& rows) {
  Transcript all;
  for (std::size_t i = 0; i < rows.size(); ++i)
    all.Append("row " + std::to_string(i) + ", ", rows[i]);
  return all;
}

// --- the laws ----------------------------------------------------------------

// M1: the life cycle of sdk/README.md.
void KeepsTheLifeCycle(const Trial& trial) {
  ModelBench bench(trial);
  // Made and destroyed unused; asked before the first update; trained inside an episode.
  bench.Make();
  const Owned<Model> model = bench.Make();
  bench.AllAnswers(model.get(), 1);
  bench.Learn(model.get(), 0, 1);
  bench.AllAnswers(model.get(), 2);
  bench.Learn(model.get(), 1, 2);
  bench.AllAnswers(model.get(), 3);
  ModelBench::Save(*model);
  bench.Learn(model.get(), 3, 1);
}

// M2
void RefusesOtherSizes(const Trial& trial) {
  ModelBench bench(trial);
  const Owned<Model> model = bench.Make();
  const Sizes& sizes = bench.sizes();
  const std::uint64_t bytes = model->latent_bytes(), longer = bytes + kLatentAlignment;
  Guarded<std::byte> from("the latents", 4 * longer), to("the imagined latents", 4 * longer);
  std::memset(from.data(), 0, from.size());
  ExpectOk(model->InitialLatent({from.data(), 2, bytes}), "InitialLatent");
  Guarded<double> actions("the actions", 4 * (sizes.action + 1)), rewards("the rewards", 4),
      discounts("the discounts", 4), values("the values", 4);
  std::fill_n(actions.data(), actions.size(), 0.0);
  const std::uint64_t seeds[4] = {1, 2, 3, 4};
  const auto refuses = [&](const char* what, const Status& status) {
    ExpectRefusal(status, StatusCode::kInvalidArgument, what);
  };
  ImagineRequest imagine;
  imagine.latents = {from.data(), 2, bytes};
  imagine.actions = {actions.data(), 2, sizes.action};
  imagine.seeds = {seeds, 2};
  ImagineResult result;
  result.latents = {to.data(), 2, bytes};
  result.rewards = {rewards.data(), 2};
  result.discounts = {discounts.data(), 2};
  NoteCall("Imagine with views of other sizes");
  ImagineRequest request = imagine;
  request.latents.cols = longer;
  refuses("Imagine with latents of another size", model->Imagine(request, result));
  request = imagine;
  request.actions.cols = sizes.action + 1;
  refuses("Imagine with actions of another size", model->Imagine(request, result));
  request = imagine;
  request.actions.rows = 3;
  refuses("Imagine with more actions than latents", model->Imagine(request, result));
  ImagineResult room = result;
  room.rewards.size = 1;
  refuses("Imagine with room for fewer rewards than latents", model->Imagine(imagine, room));
  NoteCall("Value with views of other sizes");
  refuses("Value with room for more values than latents",
          model->Value({from.data(), 2, bytes}, {values.data(), 3}));
  refuses("Value of latents of another size",
          model->Value({from.data(), 2, longer}, {values.data(), 2}));
  NoteCall("ProposeMode with views of other sizes");
  refuses("ProposeMode with room for actions of another size",
          model->ProposeMode({from.data(), 2, bytes}, {actions.data(), 2, sizes.action + 1}));
  refuses("ProposeMode with room for fewer actions than latents",
          model->ProposeMode({from.data(), 2, bytes}, {actions.data(), 1, sizes.action}));
  NoteCall("ProposeSamples with views of other sizes");
  refuses("ProposeSamples with room for no whole number of samples a latent",
          model->ProposeSamples({from.data(), 2, bytes}, {seeds, 2},
                                {actions.data(), 3, sizes.action}));
  refuses("ProposeSamples with fewer seeds than latents",
          model->ProposeSamples({from.data(), 2, bytes}, {seeds, 1},
                                {actions.data(), 4, sizes.action}));
  for (const Guarded<std::byte>* guarded : {&from, &to}) guarded->CheckGuards();
  bench.AllAnswers(model.get(), 1);
}

// M3
void SetsEveryOutput(const Trial& trial) {
  ModelBench bench(trial);
  const Owned<Model> fresh = bench.Make(), model = bench.Make();
  bench.Answers(fresh.get(), bench.Rows(3, 1), /*check=*/true);
  bench.Learn(model.get(), 0, 3, nullptr, /*check=*/true);
  for (const std::uint64_t rows : {1, 2, 7, 32}) {
    bench.Answers(model.get(), bench.Rows(rows, rows), /*check=*/true);
  }
}

// M4
void RowsStandAlone(const Trial& trial) {
  ModelBench bench(trial);
  const Owned<Model> model = bench.Make();
  bench.Learn(model.get(), 0, 2);
  constexpr std::uint64_t kRows = 9;
  const std::vector<Row> rows = bench.Rows(kRows, 3), others = bench.Rows(kRows, 4);
  const std::vector<Transcript> expected = bench.Answers(model.get(), rows);
  for (std::uint64_t i = 0; i < kRows; ++i) {
    // Other rows beside it, as many, at the same place.
    std::vector<Row> changed = others;
    changed[i] = rows[i];
    bench.Answers(model.get(), changed)[i].CheckEquals(
        expected[i], "row " + std::to_string(i) + " answered alike whatever the other rows hold");
    // At another place.
    std::swap(changed[i], changed[(i + 1) % kRows]);
    bench.Answers(model.get(), changed)[(i + 1) % kRows].CheckEquals(
        expected[i], "row " + std::to_string(i) + " answered alike at another place");
  }
}

// M5
void TheNumberOfRowsDoesNotMatter(const Trial& trial) {
  constexpr double kTolerance = 1e-5;
  ModelBench bench(trial);
  const Owned<Model> model = bench.Make();
  bench.Learn(model.get(), 0, 2);
  for (const std::uint64_t count : {2, 3, 7, 8, 33, 65}) {
    const std::vector<Row> rows = bench.Rows(count, 3);
    const std::vector<Transcript> together = bench.Answers(model.get(), rows);
    for (std::uint64_t i = 0; i<count; i += count> 8 ? 8 : 1) {
      bench.Answers(model.get(), {rows[i]})
          .front()
          .CheckEquals(together[i],
                       "a row answered alone as among " + std::to_string(count) +
                           (trial.subject().exact_rows ? ", to the bit" : ", to 1e-5"),
                       trial.subject().exact_rows ? 0 : kTolerance);
    }
  }
}

// M6
void EqualSeedsGiveEqualBits(const Trial& trial) {
  ModelBench bench(trial);
  Transcript transcripts[2];
  for (Transcript& transcript : transcripts) {
    const Owned<Model> model = bench.Make();
    bench.Learn(model.get(), 0, 3, &transcript);
    const Transcript once = bench.AllAnswers(model.get(), 8);
    transcript.Append("", once);
    bench.AllAnswers(model.get(), 8)
        .CheckEquals(once, "the same request to be answered alike again");
  }
  transcripts[1].CheckEquals(transcripts[0],
                             "a second model with the same seeds to learn and answer alike");
}

// M7
void InstancesShareNothing(const Trial& trial) {
  ModelBench bench(trial);
  Transcript expected, interleaved;
  {
    const Owned<Model> alone = bench.Make();
    bench.Learn(alone.get(), 0, 3, &expected);
    expected.Append("", bench.AllAnswers(alone.get(), 8));
  }
  const Owned<Model> other = bench.Make(2), model = bench.Make(), third = bench.Make(3);
  for (std::uint64_t update = 0; update < 3; ++update) {
    bench.Learn(other.get(), update + 10, 1);
    bench.Learn(model.get(), update, 1, &interleaved);
    bench.AllAnswers(third.get(), update);
  }
  interleaved.Append("", bench.AllAnswers(model.get(), 8));
  interleaved.CheckEquals(expected, "a model that works in turn with two others as alone");
}

// M8
void SaveAndLoadContinueToTheBit(const Trial& trial) {
  ModelBench bench(trial);
  const Owned<Model> whole = bench.Make(1);
  bench.Learn(whole.get(), 0, 2);
  const Bytes saved = ModelBench::Save(*whole);
  const auto go_on = [&](Model* model) {
    Transcript transcript;
    bench.Learn(model, 2, 2, &transcript);
    transcript.Append("", bench.AllAnswers(model, 9));
    return transcript;
  };
  const Transcript expected = go_on(whole.get());
  for (const bool used : {false, true}) {
    const std::string what = used ? "a model that was used" : "a fresh model";
    const Owned<Model> model = bench.Make(77);
    if (used) bench.Learn(model.get(), 50, 3);
    Bytes source = saved;
    NoteCall("Load");
    ExpectOk(model->Load(&source), "Load, on " + what + ", of what Save wrote");
    Expect(source.at == source.bytes.size(),
           "Load to read all " + std::to_string(source.bytes.size()) + " bytes that Save wrote",
           std::to_string(source.at));
    Expect(ModelBench::Save(*model).bytes == saved.bytes,
           "the same bytes saved again by " + what + " that loaded them", "others");
    go_on(model.get()).CheckEquals(expected, what + " that loaded to go on as the saved one");
  }
}

// M9
void RefusesBytesThatAreCut(const Trial& trial) {
  ModelBench bench(trial);
  const Owned<Model> model = bench.Make();
  const Bytes saved = ModelBench::Save(*model);
  if (saved.bytes.empty()) Skip("Save writes nothing");
  for (const std::size_t part : {0, 1, 8, 15, 16}) {
    Bytes cut;
    const std::size_t length = part == 16 ? saved.bytes.size() - 1 : saved.bytes.size() * part / 16;
    cut.bytes.assign(saved.bytes.begin(),
                     saved.bytes.begin() + static_cast<std::ptrdiff_t>(length));
    const Owned<Model> other = bench.Make();
    NoteCall("Load of bytes that are cut");
    ExpectRefusal(other->Load(&cut), StatusCode::kDataLoss,
                  "Load of the first " + std::to_string(length) + " of " +
                      std::to_string(saved.bytes.size()) + " bytes");
  }
}

// M10
void AllocatesNothingAfterTheFirstCalls(const Trial& trial) {
  if (!CountsAllocations()) Skip("this process does not count allocations");
  ModelBench bench(trial);
  const Owned<Model> model = bench.Make();
  const std::vector<Row> most = bench.Rows(32, 3), fewer = bench.Rows(5, 4);
  bench.Answers(model.get(), most);
  for (const std::vector<Row>* rows : {&most, &fewer, &most}) {
    bench.Answers(model.get(), *rows);
    Expect(bench.allocations() == 0,
           "no allocation by a request that is not larger than one before",
           std::to_string(bench.allocations()) + " in a request of " +
               std::to_string(rows->size()) + " rows");
  }
}

// M11
void SurvivesWhatIsNotFinite(const Trial& trial) {
  ModelBench bench(trial);
  const Owned<Model> model = bench.Make();
  bench.Learn(model.get(), 0, 1);
  const Transcript expected = bench.AllAnswers(model.get(), 8);
  if (trial.Has(kLearns)) {
    for (const float hostile :
         {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e38f}) {
      for (const bool reward : {false, true}) {
        const Bytes before = ModelBench::Save(*model);
        Batch batch(bench.sizes(), trial.Has(kLearnsFromSearch), 5);
        (reward ? batch.rewards : batch.observations)[5] = hostile;
        const std::string what =
            std::string(reward ? "a reward" : "an observation") + " of " + Number(hostile);
        const Status status = bench.Train(model.get(), batch, 1);
        // A number that is large and finite may be learned, if all that follows from it is finite.
        if (std::isfinite(hostile) && status.ok()) {
          Bytes source = before;
          ExpectOk(model->Load(&source), "Load");
          continue;
        }
        ExpectRefusal(status, StatusCode::kNotFinite, "Train with " + what);
        Expect(ModelBench::Save(*model).bytes == before.bytes,
               "a model that is unchanged after Train met " + what, "other saved bytes");
      }
    }
  }
  for (const double hostile : {kUnset, std::numeric_limits<double>::infinity(), 1e300}) {
    std::vector<Row> rows = bench.Rows(2, 8);
    rows[1].observation[0] = hostile;
    try {
      bench.Answers(model.get(), rows);
    } catch (const Broken&) {
      // Any failure will do, and numbers that are not finite are found by the host.
    }
  }
  bench.AllAnswers(model.get(), 8)
      .CheckEquals(expected, "a model that answers as before after hostile observations");
}

// M12
void ThreadsDoNotMatter(const Trial& trial) {
  ModelBench bench(trial);
  Transcript transcripts[2];
  for (const std::uint32_t several : {0, 1}) {
    const Owned<Model> model = bench.Make();
    for (std::uint32_t update = 0; update < 3; ++update) {
      NoteCall("SetThreads");
      model->SetThreads(several == 0 ? 1 : 2 + update);
      bench.Learn(model.get(), update, 1, &transcripts[several]);
    }
    transcripts[several].Append("", bench.AllAnswers(model.get(), 8));
  }
  transcripts[1].CheckEquals(transcripts[0], "the same bits on 2 to 4 threads as on one");
}

class Tensors final : public TensorSink {
 public:
  Status Tensor(const char* name, View<const std::uint64_t> shape,
                View<const float> values) noexcept override {
    std::uint64_t size = 1;
    for (const std::uint64_t n : shape) size *= n;
    fit &= name != nullptr && size == values.size;
    return OkStatus();
  }
  bool fit = true;
};

// M13
void ExportsWhatItNames(const Trial& trial) {
  ModelBench bench(trial);
  const Owned<Model> model = bench.Make();
  const Bytes before = ModelBench::Save(*model);
  auto* exported = ExtensionOf<TensorExport>(model.get());
  if (exported == nullptr) Skip("it does not offer TensorExport");
  Tensors tensors;
  NoteCall("Export");
  ExpectOk(exported->Export(&tensors), "Export");
  Expect(tensors.fit, "tensors whose shape has as many entries as they have values", "others");
  Expect(ModelBench::Save(*model).bytes == before.bytes, "a model unchanged by Export and Save",
         "other saved bytes");
}

// Sequences of actions from latents that were observed, for M14.
class Sequences {
 public:
  static constexpr std::uint64_t kCount = 3, kHorizon = 3;  // B, H

  Sequences(ModelBench* bench, Model* model)
      : action_size_(bench->sizes().action),
        latent_bytes_(model->latent_bytes()),
        latents_("the latents", kCount * latent_bytes_),
        actions_(kCount * kHorizon * action_size_),
        seeds_(kCount * kHorizon) {
    const std::vector<std::byte> observed = bench->Observed(model, bench->Rows(kCount, 6));
    std::copy(observed.begin(), observed.end(), latents_.data());
    Random random(11);
    for (double& action : actions_) action = random.Uniform(-0.7, 0.7);
    FillSeeds(12, {seeds_.data(), seeds_.size()});
  }

  // Of sequences `first` ... `first` + count - 1; the value as `how` says.
  GradientRequest Request(std::uint64_t first, std::uint64_t count,
                          const GradientRequest& how) const {
    GradientRequest request;
    request.latents = {latents_.data() + first * latent_bytes_, count, latent_bytes_};
    request.actions = {actions_.data() + first * kHorizon * action_size_, count * kHorizon,
                       action_size_};
    request.seeds = {seeds_.data() + first * kHorizon, count * kHorizon};
    request.deviations = how.deviations;
    request.least = how.least;
    return request;
  }

  // The returns by the calls that a planner without gradients makes.
  std::vector<double> Imagined(Model* model, const GradientRequest& how) const {
    Guarded<std::byte> from("the latents", kCount * latent_bytes_),
        to("the imagined latents", kCount * latent_bytes_);
    std::copy_n(latents_.data(), latents_.size(), from.data());
    std::vector<double> returns(kCount), left(kCount, 1.0), rewards(kCount), discounts(kCount);
    std::vector<double> actions(kCount * action_size_), deviations(kCount), least(kCount);
    std::vector<std::uint64_t> seeds(kCount);
    for (std::uint64_t t = 0; t < kHorizon; ++t) {
      for (std::uint64_t b = 0; b < kCount; ++b) {
        const std::uint64_t row = b * kHorizon + t;
        std::copy_n(&actions_[row * action_size_], action_size_, &actions[b * action_size_]);
        seeds[b] = seeds_[row];
      }
      NoteCall("Imagine");
      ExpectOk(model->Imagine({{from.data(), kCount, latent_bytes_},
                               {actions.data(), kCount, action_size_},
                               {seeds.data(), kCount}},
                              {{to.data(), kCount, latent_bytes_},
                               {rewards.data(), kCount},
                               {discounts.data(), kCount}}),
               "Imagine");
      for (std::uint64_t b = 0; b < kCount; ++b) {
        returns[b] += left[b] * rewards[b];
        left[b] *= discounts[b];
      }
      std::copy_n(to.data(), to.size(), from.data());
    }
    const ConstLatents last{from.data(), kCount, latent_bytes_};
    std::vector<double>& values = rewards;
    if (auto* spread = ExtensionOf<ValueSpread>(model)) {
      NoteCall("Spread");
      ExpectOk(
          spread->Spread(
              last, {{values.data(), kCount}, {deviations.data(), kCount}, {least.data(), kCount}}),
          "Spread");
      for (std::uint64_t b = 0; b < kCount; ++b) {
        values[b] = how.least ? least[b] : values[b] + how.deviations * deviations[b];
      }
    } else {
      NoteCall("Value");
      ExpectOk(model->Value(last, {values.data(), kCount}), "Value");
    }
    for (std::uint64_t b = 0; b < kCount; ++b) returns[b] += left[b] * values[b];
    return returns;
  }

  double& action(std::uint64_t sequence, std::uint64_t i) {
    return actions_[sequence * kHorizon * action_size_ + i];
  }

 private:
  const std::uint64_t action_size_, latent_bytes_;
  Guarded<std::byte> latents_;
  std::vector<double> actions_;
  std::vector<std::uint64_t> seeds_;
};

// M14. A central difference with step h is h^2 / 6 times a third derivative from the slope, and
// eps |return| / h where the model computes with a precision of eps: a slope is right if it is by
// one of several steps. kRounding is that of floats and the largest step, ten times.
void GivesTheGradientOfItsReturns(const Trial& trial) {
  constexpr double kSteps[] = {0.2, 0.05, 0.01, 1e-3}, kOfTheLargest = 0.05, kOfTheReturn = 1e-4,
                   kRounding = 3e-6;
  constexpr std::uint64_t kCount = Sequences::kCount;
  ModelBench bench(trial);
  const Owned<Model> model = bench.Make();
  auto* differentiable = ExtensionOf<ReturnGradient>(model.get());
  const bool declared = trial.Has(kGivesGradients);
  if (differentiable == nullptr && !declared) Skip("it does not offer ReturnGradient");
  Expect((differentiable != nullptr) == declared,
         "ReturnGradient offered where the trait kGivesGradients is declared, and nowhere else",
         declared ? "the trait alone" : "the extension alone");
  bench.Learn(model.get(), 0, 3);
  Sequences sequences(&bench, model.get());
  const std::uint64_t width = Sequences::kHorizon * bench.sizes().action;
  Guarded<double> returns("the returns", kCount), gradients("the gradients", kCount * width);
  const auto ask = [&](std::uint64_t first, std::uint64_t count, const GradientRequest& how) {
    returns.Unset();
    gradients.Unset();
    NoteCall("Gradient");
    return differentiable->Gradient(
        sequences.Request(first, count, how),
        {{returns.data(), count},
         {gradients.data(), count * Sequences::kHorizon, bench.sizes().action}});
  };
  const auto deviate = [](double deviations, bool least) {
    GradientRequest how;
    how.deviations = deviations;
    how.least = least;
    return how;
  };
  std::vector<GradientRequest> ways = {deviate(0, false)};
  if (ExtensionOf<ValueSpread>(model.get()) != nullptr) {
    ways.push_back(deviate(0.5, false));
    ways.push_back(deviate(0, true));
  }
  for (const GradientRequest& how : ways) {
    ExpectOk(ask(0, kCount, how), "Gradient");
    for (const Guarded<double>* room : {&returns, &gradients}) {
      room->CheckGuards();
      room->CheckSet();
    }
    const std::vector<double> reported(returns.data(), returns.data() + kCount);
    const std::vector<double> slopes(gradients.data(), gradients.data() + gradients.size());
    const std::vector<double> imagined = sequences.Imagined(model.get(), how);
    for (std::uint64_t b = 0; b < kCount; ++b) {
      Expect(std::abs(reported[b] - imagined[b]) <=
                 kOfTheReturn * std::max(1.0, std::abs(imagined[b])),
             "the return of sequence " + std::to_string(b) +
                 " by Imagine and the value of the last latent, " + Number(imagined[b]),
             Number(reported[b]));
    }
    // The return that Gradient reports when entry i of every sequence is moved by `step`.
    const auto moved = [&](std::uint64_t i, double step) {
      for (std::uint64_t b = 0; b < kCount; ++b) sequences.action(b, i) += step;
      ExpectOk(ask(0, kCount, how), "Gradient");
      for (std::uint64_t b = 0; b < kCount; ++b) sequences.action(b, i) -= step;
      return std::vector<double>(returns.data(), returns.data() + kCount);
    };
    for (std::uint64_t i = 0; i < width; ++i) {
      double nearest[kCount];
      std::fill_n(nearest, kCount, std::numeric_limits<double>::infinity());
      for (const double step : kSteps) {
        const std::vector<double> above = moved(i, step), below = moved(i, -step);
        for (std::uint64_t b = 0; b < kCount; ++b) {
          const double difference = (above[b] - below[b]) / (2 * step);
          const double slope = slopes[b * width + i];
          if (std::abs(difference - slope) < std::abs(nearest[b] - slope)) nearest[b] = difference;
        }
      }
      for (std::uint64_t b = 0; b < kCount; ++b) {
        double largest = 0;
        for (std::uint64_t j = 0; j < width; ++j) {
          largest = std::max(largest, std::abs(slopes[b * width + j]));
        }
        const double slope = slopes[b * width + i];
        Expect(std::abs(nearest[b] - slope) <=
                   kOfTheLargest * largest + kRounding * (1 + std::abs(reported[b])),
               Format("the central difference of return %llu for action %llu, entry %llu: ",
                      static_cast<unsigned long long>(b),
                      static_cast<unsigned long long>(i / bench.sizes().action),
                      static_cast<unsigned long long>(i % bench.sizes().action)) +
                   Number(nearest[b]),
               "a gradient of " + Number(slope));
      }
    }
    // Alone as among others.
    for (std::uint64_t b = 0; b < kCount; ++b) {
      ExpectOk(ask(b, 1, how), "Gradient");
      Transcript alone, among;
      alone.Add("return", returns[0]);
      among.Add("return", reported[b]);
      alone.Add("gradient", {gradients.data(), width});
      among.Add("gradient", {&slopes[b * width], width});
      alone.CheckEquals(among, "a sequence answered alone as among " + std::to_string(kCount),
                        trial.subject().exact_rows ? 0 : 1e-5);
    }
  }
  GradientRequest fewer = sequences.Request(0, kCount, {});
  fewer.seeds.size -= 1;
  NoteCall("Gradient with views of other sizes");
  ExpectRefusal(differentiable->Gradient(
                    fewer, {returns.view(), gradients.rows(kCount * Sequences::kHorizon)}),
                StatusCode::kInvalidArgument, "Gradient with fewer seeds than actions");
}

constexpr Law kLaws[] = {
    {"M1", kOfModels, Level::kLaws, "keeps the life cycle",
     "See the table of the life cycle in sdk/README.md: any call may follow any other, Train "
     "inside an "
     "episode too",
     KeepsTheLifeCycle},
    {"M2", kOfModels, Level::kLaws, "refuses views of other sizes, unharmed",
     "Compare the sizes of all views at the beginning of every call", RefusesOtherSizes},
    {"M3", kOfModels, Level::kLaws,
     "sets every output, actions and discounts in their ranges, and writes nothing beside its "
     "views",
     "Fill every view for every row; discounts lie in [0, 1], actions in [-1, 1]", SetsEveryOutput},
    {"M4", kOfModels, Level::kLaws, "a row's answer does not depend on the other rows",
     "Normalise with stored statistics, never with those of the batch, and draw from the row's own "
     "seed",
     RowsStandAlone},
    {"M5", kOfModels, Level::kLaws, "a row's answer does not depend on the number of rows",
     "Rounding may differ between kernels for one row and many; anything more is a row that looks "
     "at "
     "others",
     TheNumberOfRowsDoesNotMatter},
    {"M6", kOfModels, Level::kLaws, "equal seeds give equal bits",
     "Draw from the request's seeds alone, and initialise every member", EqualSeedsGiveEqualBits},
    {"M7", kOfModels, Level::kLaws, "the order and number of instances do not matter",
     "Keep state in members, never in static or thread_local variables", InstancesShareNothing},
    {"M8", kOfModels, Level::kLaws, "Save and Load continue to the bit",
     "Save all that decides the future: parameters, optimiser moments, statistics, counters; Load "
     "reads "
     "the same in the same order",
     SaveAndLoadContinueToTheBit},
    {"M9", kOfModels, Level::kLaws, "refuses saved bytes that are cut",
     "Return the Status of every Read", RefusesBytesThatAreCut},
    {"M10", kOfModels, Level::kLaws, "allocates nothing for a request that is not larger",
     "Keep the buffers of the largest request: planners call many times a decision",
     AllocatesNothingAfterTheFirstCalls},
    {"M11", kOfModels, Level::kExtremes, "survives what is not finite",
     "Look at losses and gradient norms before the parameters are changed, and return kNotFinite",
     SurvivesWhatIsNotFinite},
    {"M12", kOfModels, Level::kLaws, "the number of threads does not matter",
     "Split the work in parts that do not depend on the number of threads, and add them up in "
     "order",
     ThreadsDoNotMatter},
    {"M13", kOfModels, Level::kLaws, "exports tensors that fit their shapes, unharmed",
     "The shape's product is the number of values; Save and Export change nothing",
     ExportsWhatItNames},
    {"M14", kOfModels, Level::kLaws, "gives the gradient of the returns that it imagines",
     "Compare with central differences of the return, one term at a time: rewards, discounts, the "
     "value of the last latent, and what the first actions change of all that follows",
     GivesTheGradientOfItsReturns},
};

}  // namespace

View<const Law> ModelLaws() { return ViewOf(kLaws); }

void UseModel(const Trial& trial, int calls) {
  ModelBench bench(trial);
  const Owned<Model> model = bench.Make();
  bench.Learn(model.get(), 0, calls > 8 ? 2 : 1, nullptr, trial.strict());
  for (int i = 0; i < calls; ++i) {
    bench.Answers(model.get(), bench.Rows(4, static_cast<std::uint64_t>(i)), trial.strict());
  }
}

}  // namespace dreamsearch::check
