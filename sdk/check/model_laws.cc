// model_laws.cc - the laws of model.h, one function each; M14 is gradient_law.h.
#include "dreamsearch/random.h"
#include "gradient_law.h"
#include "law.h"
#include "model_bench.h"
#include "tools.h"

namespace dreamsearch::check {
namespace {

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
