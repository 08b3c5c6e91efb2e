// planner_laws.cc - the laws of planner.h, one function each. Over 400 lines: they share their
// subjects.
#include <functional>

#include "dreamsearch/random.h"
#include "law.h"
#include "probe_model.h"
#include "tools.h"

namespace dreamsearch::check {
namespace {

class CountEdges final : public TreeSink {
 public:
  void Edge(const TreeEdge& edge) noexcept override {
    parents_come_first &= edge.parent < static_cast<std::int64_t>(edges);
    finite &= std::isfinite(edge.q) && std::isfinite(edge.reward) && std::isfinite(edge.value);
    ++edges;
  }
  std::uint64_t edges = 0;
  bool parents_come_first = true;
  bool finite = true;
};

struct Ask {
  bool explore = false;
  std::uint64_t seed = 1;
  std::uint64_t root = 1;  // which latent is decided at
  std::uint64_t decision = 0;
};

// A planner on a probe model, and room for what it answers.
class PlannerBench {
 public:
  explicit PlannerBench(const Trial& trial)
      : trial_(trial),
        model(trial.sizes().action, trial.sizes().latent_bytes),
        root_("the root latent", trial.sizes().latent_bytes),
        action_("the action", trial.sizes().action),
        metrics_("the metrics", trial.component().metrics.size) {}

  Owned<Planner> Make() {
    PlannerContext context;
    context.parameters = trial_.parameters();
    context.action_size = trial_.sizes().action;
    context.latent_bytes = trial_.sizes().latent_bytes;
    NoteCall("the factory");
    Planner* made = nullptr;
    const Status status = trial_.component().create_planner(context, &made);
    return Take(status, made);
  }
  Owned<Planner> MakeAndBegin() {
    Owned<Planner> planner = Make();
    Begin(planner.get());
    return planner;
  }
  void Begin(Planner* planner) {
    NoteCall("BeginEpisode");
    ExpectOk(planner->BeginEpisode(&model), "BeginEpisode");
  }

  // One decision.
  Status Plan(Planner* planner, const Ask& ask) {
    action_.Unset();
    metrics_.Unset();
    model.MakeLatent(ask.root, {root_.data(), 1, root_.size()});
    const std::vector<std::byte> before(root_.data(), root_.data() + root_.size());
    PlanRequest request;
    request.root = {root_.data(), 1, root_.size()};
    request.explore = ask.explore;
    request.seed = ask.seed;
    request.decision = ask.decision;
    request.environment_step = 1000000 + ask.decision;
    PlanResult result;
    result.action = action_.view();
    result.metrics = metrics_.view();
    result.value = kUnset;
    NoteCall("Plan, decision " + std::to_string(ask.decision));
    const std::uint64_t allocations = Allocations();
    const Status status = planner->Plan(request, &result);
    allocations_ = Allocations() - allocations;
    value_ = result.value;
    root_changed_ = !std::equal(before.begin(), before.end(), root_.data());
    return status;
  }
  // The same, which must succeed.
  void Decide(Planner* planner, const Ask& ask, Transcript* transcript = nullptr) {
    ExpectOk(Plan(planner, ask), "Plan");
    if (transcript == nullptr) return;
    const std::string which = "decision " + std::to_string(ask.decision) + ", ";
    transcript->Add(which + "action", action_.view());
    transcript->Add(which + "metric", metrics_.view());
    transcript->Add(which + "value", value_);
  }
  // That the last decision set everything, in its range, and nothing else.
  void CheckAnswers() const {
    for (const Guarded<double>* room : {&action_, &metrics_}) {
      room->CheckGuards();
    }
    root_.CheckGuards();
    Expect(!root_changed_, "the root latent unchanged", "bytes written to it");
    action_.CheckSet();
    action_.CheckRange(-1, 1);
    metrics_.CheckSet();
    Expect(std::isfinite(value_), "a finite value of the root",
           std::isnan(value_) ? "NaN, or it was not set" : "infinity");
  }

  std::uint64_t allocations() const { return allocations_; }

 private:
  const Trial& trial_;

 public:
  ProbeModel model;

 private:
  Guarded<std::byte> root_;
  Guarded<double> action_, metrics_;
  double value_ = kUnset;
  std::uint64_t allocations_ = 0;
  bool root_changed_ = false;
};

// An episode of `count` decisions, the later half exploring.
void Episode(PlannerBench* bench, Planner* planner, std::uint64_t seed, std::uint64_t count,
             Transcript* transcript) {
  for (std::uint64_t i = 0; i < count; ++i) {
    bench->Decide(
        planner,
        {.explore = i >= count / 2, .seed = DeriveSeed(seed, i), .root = seed + i, .decision = i},
        transcript);
  }
}

constexpr std::uint64_t kDecisions = 4;

// --- the laws ----------------------------------------------------------------

// P1: the life cycle of sdk/README.md.
void RefusesCallsThatComeTooEarly(const Trial& trial) {
  PlannerBench bench(trial);
  const Owned<Planner> planner = bench.Make();
  ExpectRefusal(bench.Plan(planner.get(), {}), StatusCode::kFailedPrecondition,
                "Plan before BeginEpisode");
  bench.Begin(planner.get());
  bench.Decide(planner.get(), {});
  // An episode may end at any decision, also before the first.
  bench.Begin(planner.get());
  bench.Begin(planner.get());
  bench.Decide(planner.get(), {});
  // Made and destroyed without an episode.
  bench.Make();
}

// P2
void RefusesOtherSizes(const Trial& trial) {
  PlannerBench bench(trial);
  const Owned<Planner> planner = bench.MakeAndBegin();
  NoteCall("BeginEpisode with null");
  ExpectRefusal(planner->BeginEpisode(nullptr), StatusCode::kInvalidArgument,
                "BeginEpisode with a model that is null");
  const Sizes& sizes = trial.sizes();
  ProbeModel wider(sizes.action + 1, sizes.latent_bytes);
  ProbeModel longer(sizes.action, sizes.latent_bytes + kLatentAlignment);
  for (ProbeModel* other : {&wider, &longer}) {
    NoteCall("BeginEpisode with a model of other sizes");
    ExpectRefusal(planner->BeginEpisode(other), StatusCode::kInvalidArgument,
                  "BeginEpisode with a model of other sizes than the context's");
  }
  // The episode before goes on.
  bench.Decide(planner.get(), {});

  Guarded<std::byte> root("the root latent", 2 * (sizes.latent_bytes + kLatentAlignment));
  Guarded<double> action("the action", sizes.action + 1);
  Guarded<double> metrics("the metrics", trial.component().metrics.size + 1);
  bench.model.MakeLatent(1, {root.data(), 1, sizes.latent_bytes});
  PlanRequest request;
  request.root = {root.data(), 1, sizes.latent_bytes};
  PlanResult result;
  result.action = {action.data(), sizes.action};
  result.metrics = {metrics.data(), trial.component().metrics.size};
  const auto refuses = [&](const char* what, const PlanRequest& asked, PlanResult* room) {
    NoteCall(std::string("Plan with ") + what);
    ExpectRefusal(planner->Plan(asked, room), StatusCode::kInvalidArgument,
                  std::string("Plan with ") + what);
  };
  PlanRequest wrong = request;
  wrong.root.rows = 2;
  refuses("two roots", wrong, &result);
  wrong = request;
  wrong.root.cols = sizes.latent_bytes + kLatentAlignment;
  refuses("a root of another size", wrong, &result);
  const auto refuses_room = [&](const char* what, std::uint64_t actions,
                                std::uint64_t metrics_room) {
    PlanResult room;
    room.action = {action.data(), actions};
    room.metrics = {metrics.data(), metrics_room};
    refuses(what, request, &room);
  };
  refuses_room("room for one component of the action too many", sizes.action + 1,
               result.metrics.size);
  refuses_room("room for one component of the action too few", sizes.action - 1,
               result.metrics.size);
  refuses_room("room for one metric too many", sizes.action, result.metrics.size + 1);
  refuses("a result that is null", request, nullptr);
  bench.Decide(planner.get(), {});
}

// P3
void SetsEveryOutput(const Trial& trial) {
  PlannerBench bench(trial);
  const Owned<Planner> planner = bench.MakeAndBegin();
  for (std::uint64_t i = 0; i < 10; ++i) {
    bench.Decide(planner.get(), {.explore = i % 2 == 1, .seed = i, .root = i, .decision = i});
    bench.CheckAnswers();
  }
}

// P4
void EqualSeedsGiveEqualBits(const Trial& trial) {
  PlannerBench bench(trial);
  const Owned<Planner> first = bench.MakeAndBegin();
  Transcript expected;
  Episode(&bench, first.get(), 7, kDecisions, &expected);
  const Owned<Planner> second = bench.MakeAndBegin();
  Transcript other;
  Episode(&bench, second.get(), 7, kDecisions, &other);
  other.CheckEquals(expected, "a second planner with the same seeds to decide alike");
  // BeginEpisode forgets the episode before.
  bench.Begin(first.get());
  Episode(&bench, first.get(), 99, kDecisions, nullptr);
  bench.Begin(first.get());
  Transcript again;
  Episode(&bench, first.get(), 7, kDecisions, &again);
  again.CheckEquals(expected, "the same planner, after another episode, to decide alike");
}

// P5
void InstancesShareNothing(const Trial& trial) {
  PlannerBench bench(trial), beside(trial);
  Transcript expected;
  {
    const Owned<Planner> alone = bench.MakeAndBegin();
    Episode(&bench, alone.get(), 7, kDecisions, &expected);
  }
  const Owned<Planner> other = beside.MakeAndBegin();
  const Owned<Planner> third = beside.MakeAndBegin();
  const Owned<Planner> planner = bench.MakeAndBegin();
  Transcript interleaved;
  for (std::uint64_t i = 0; i < kDecisions; ++i) {
    beside.Decide(other.get(), {.seed = 1000 + i, .root = 50 + i, .decision = i});
    bench.Decide(
        planner.get(),
        {.explore = i >= kDecisions / 2, .seed = DeriveSeed(7, i), .root = 7 + i, .decision = i},
        &interleaved);
    beside.Decide(third.get(), {.explore = true, .seed = 2000 + i, .root = 70 + i, .decision = i});
  }
  interleaved.CheckEquals(expected, "a planner that decides in turn with two others as alone");
}

// P6
void SaveAndLoadContinueToTheBit(const Trial& trial) {
  PlannerBench bench(trial);
  for (std::uint64_t saved_at = 0; saved_at < kDecisions; ++saved_at) {
    const Owned<Planner> whole = bench.MakeAndBegin();
    Episode(&bench, whole.get(), 3, saved_at, nullptr);
    Bytes saved;
    NoteCall("Save");
    ExpectOk(whole->Save(&saved), "Save");
    const auto go_on = [&](Planner* planner, Transcript* transcript) {
      for (std::uint64_t i = saved_at; i < saved_at + 3; ++i) {
        bench.Decide(planner, {.explore = i % 2 == 0, .seed = 40 + i, .root = 3 + i, .decision = i},
                     transcript);
      }
    };
    Transcript expected, found;
    go_on(whole.get(), &expected);
    const Owned<Planner> resumed = bench.MakeAndBegin();
    NoteCall("Load");
    ExpectOk(resumed->Load(&saved), "Load of what Save wrote");
    Expect(saved.at == saved.bytes.size(),
           "Load to read all " + std::to_string(saved.bytes.size()) + " bytes that Save wrote",
           std::to_string(saved.at));
    go_on(resumed.get(), &found);
    found.CheckEquals(expected, "a new planner that loaded what was saved before decision " +
                                    std::to_string(saved_at) + " to decide as the saved one");
  }
}

// P7
void RefusesBytesThatAreCut(const Trial& trial) {
  PlannerBench bench(trial);
  const Owned<Planner> planner = bench.MakeAndBegin();
  Episode(&bench, planner.get(), 3, 2, nullptr);
  Bytes saved;
  NoteCall("Save");
  ExpectOk(planner->Save(&saved), "Save");
  if (saved.bytes.empty()) Skip("Save writes nothing");
  const std::size_t step = std::max<std::size_t>(1, saved.bytes.size() / 16);
  for (std::size_t length = 0; length < saved.bytes.size(); length += step) {
    Bytes cut;
    cut.bytes.assign(saved.bytes.begin(),
                     saved.bytes.begin() + static_cast<std::ptrdiff_t>(length));
    const Owned<Planner> other = bench.MakeAndBegin();
    NoteCall("Load of bytes that are cut");
    ExpectRefusal(other->Load(&cut), StatusCode::kDataLoss,
                  "Load of the first " + std::to_string(length) + " of " +
                      std::to_string(saved.bytes.size()) + " bytes");
  }
}

// P8
void AllocatesNothingAfterTheFirstPlan(const Trial& trial) {
  if (!CountsAllocations()) Skip("this process does not count allocations");
  PlannerBench bench(trial);
  const Owned<Planner> planner = bench.MakeAndBegin();
  bench.Decide(planner.get(), {});
  for (std::uint64_t i = 1; i < 12; ++i) {
    if (i == 8) bench.Begin(planner.get());
    bench.Decide(planner.get(), {.explore = i % 4 == 2, .seed = i, .root = i, .decision = i % 8});
    Expect(bench.allocations() == 0, "no allocation once Plan has run",
           std::to_string(bench.allocations()) + " in call " + std::to_string(i + 1));
  }
}

// P9
void PassesOnErrorsOfTheModel(const Trial& trial) {
  PlannerBench bench(trial);
  const Owned<Planner> planner = bench.MakeAndBegin();
  bench.model.calls = 0;
  bench.Decide(planner.get(), {.explore = true});
  const std::uint64_t calls = bench.model.calls;
  if (calls == 0) Skip("it does not ask the model");
  const std::uint64_t step = std::max<std::uint64_t>(1, calls / 12);
  for (std::uint64_t good = 0; good < calls; good += step) {
    bench.Begin(planner.get());
    bench.model.calls = 0;
    bench.model.answers = ProbeModel::Answers::kFails;
    bench.model.calls_until_failure = good;
    const Status status = bench.Plan(planner.get(), {.explore = true});
    const std::string which = "Plan, of which the model's call " + std::to_string(good + 1) +
                              " of " + std::to_string(calls) + " fails,";
    Expect(!status.ok(), which + " to fail", "success");
    Expect(status.code == StatusCode::kInternal, which + " to pass on the model's error",
           Text(status));
    bench.model.answers = ProbeModel::Answers::kGood;
  }
  bench.Begin(planner.get());
  bench.Decide(planner.get(), {});
}

// P10
void FindsWhatIsNotFinite(const Trial& trial) {
  PlannerBench bench(trial);
  using Answers = ProbeModel::Answers;
  for (const Answers answers : {Answers::kNan, Answers::kInfinite, Answers::kHuge}) {
    const Owned<Planner> planner = bench.MakeAndBegin();
    bench.model.answers = answers;
    bench.model.calls = 0;
    const Status status = bench.Plan(planner.get(), {.explore = true});
    const std::string which = answers == Answers::kNan        ? "NaN"
                              : answers == Answers::kInfinite ? "infinity"
                                                              : "rewards and values of 1e300";
    bench.model.answers = Answers::kGood;
    if (status.ok()) {
      // What was asked may not have been needed.
      bench.CheckAnswers();
      if (answers != Answers::kHuge && bench.model.calls > 0) {
        Expect(false, "kNotFinite where the model answers " + which, "success");
      }
    } else {
      Expect(status.code == StatusCode::kNotFinite, "kNotFinite where the model answers " + which,
             Text(status));
    }
    bench.Begin(planner.get());
    bench.Decide(planner.get(), {});
  }
}

// The improved policy of the last decision, if the planner offers one: its law, held.
void CheckPolicy(Planner* planner, std::uint64_t action_size, std::uint64_t size) {
  auto* reporting = ExtensionOf<PolicyReporting>(planner);
  if (reporting == nullptr) return;
  Guarded<double> actions("the policy's actions", size * action_size);
  Guarded<double> weights("the policy's weights", size);
  NoteCall("ReportPolicy");
  ExpectOk(reporting->ReportPolicy(actions.rows(size), weights.view()), "ReportPolicy");
  for (const Guarded<double>* room : {&actions, &weights}) {
    room->CheckGuards();
    room->CheckSet();
  }
  actions.CheckRange(-1, 1);
  double sum = 0, last = 2;
  for (const double weight : weights.view()) {
    Expect(weight >= 0 && weight <= last, "weights that are not negative, heaviest first",
           Number(weight) + " after " + Number(last));
    sum += last = weight;
  }
  Expect(std::abs(sum - 1) < 1e-6, "weights of the policy that sum to 1", Number(sum));
  ExpectRefusal(reporting->ReportPolicy({actions.data(), size, action_size + 1}, weights.view()),
                StatusCode::kInvalidArgument, "ReportPolicy with room for other actions");
}

// P11
void ReportingChangesNothing(const Trial& trial) {
  PlannerBench bench(trial);
  Transcript transcripts[2];
  for (const bool report : {false, true}) {
    const Owned<Planner> planner = bench.MakeAndBegin();
    for (std::uint64_t i = 0; i < kDecisions; ++i) {
      bench.Decide(planner.get(), {.explore = true, .seed = i, .root = i, .decision = i},
                   &transcripts[report ? 1 : 0]);
      if (!report) continue;
      if (auto* reporting = ExtensionOf<TreeReporting>(planner.get())) {
        CountEdges tree;
        NoteCall("ReportTree");
        reporting->ReportTree(&tree);
        Expect(tree.parents_come_first, "a tree whose parents come first",
               "an edge before its parent");
        Expect(tree.finite, "finite numbers in the tree", "others");
      }
      if (auto* reporting = ExtensionOf<PolicyReporting>(planner.get())) {
        Guarded<double> actions("the policy's actions", 3 * trial.sizes().action);
        Guarded<double> weights("the policy's weights", 3);
        NoteCall("ReportPolicy");
        ExpectOk(reporting->ReportPolicy(actions.rows(3), weights.view()), "ReportPolicy");
      }
    }
  }
  transcripts[1].CheckEquals(transcripts[0],
                             "the same decisions where tree and policy are reported");
}

// P12
void DoesWhatItsTraitsSay(const Trial& trial) {
  PlannerBench bench(trial);
  const Owned<Planner> planner = bench.MakeAndBegin();
  Episode(&bench, planner.get(), 5, kDecisions, nullptr);
  Expect(trial.Has(kSearches) || bench.model.imagined == 0,
         "no call of Imagine by a planner that does not declare kSearches",
         std::to_string(bench.model.imagined) + " transitions");
  if (trial.Has(kActorAlone)) {
    Transcript one, other;
    bench.Decide(bench.MakeAndBegin().get(), {.seed = 1}, &one);
    bench.Decide(bench.MakeAndBegin().get(), {.seed = 2}, &other);
    other.CheckEquals(one,
                      "a planner that declares kActorAlone to draw nothing while not exploring");
  }
  Expect(trial.Has(kReportsPolicy) == (ExtensionOf<PolicyReporting>(planner.get()) != nullptr),
         "the extension PolicyReporting of a planner that declares kReportsPolicy, and of no other",
         trial.Has(kReportsPolicy) ? "none" : "one");
  for (const std::uint64_t size : {1, 2, 16}) {
    bench.Decide(planner.get(), {.explore = true});
    CheckPolicy(planner.get(), trial.sizes().action, size);
  }
}

// P13
void AsksTheModelAsItShould(const Trial& trial) {
  PlannerBench bench(trial);
  const Owned<Planner> planner = bench.MakeAndBegin();
  Episode(&bench, planner.get(), 5, kDecisions, nullptr);
  bench.model.CheckCalls();
  if (bench.model.calls == 0) Remark("it does not ask the model");
}

constexpr Law kLaws[] = {
    {"P1", kOfPlanners, Level::kLaws, "keeps the life cycle",
     "See the table of the life cycle in sdk/README.md; CheckPlan (planning.h) refuses what comes "
     "too "
     "early",
     RefusesCallsThatComeTooEarly},
    {"P2", kOfPlanners, Level::kLaws, "refuses null and views of other sizes, unharmed",
     "Begin BeginEpisode with CheckModel and Plan with CheckPlan (planning.h)", RefusesOtherSizes},
    {"P3", kOfPlanners, Level::kLaws,
     "sets every output, actions in [-1, 1], and writes nothing beside its views",
     "Fill result->action, every declared metric and result->value on every path to OkStatus",
     SetsEveryOutput},
    {"P4", kOfPlanners, Level::kLaws, "equal seeds give equal bits, whatever came before",
     "Draw from Random(request.seed) alone, and forget everything in BeginEpisode",
     EqualSeedsGiveEqualBits},
    {"P5", kOfPlanners, Level::kLaws, "the order and number of instances do not matter",
     "Keep state in members, never in static or thread_local variables", InstancesShareNothing},
    {"P6", kOfPlanners, Level::kLaws, "Save and Load continue to the bit",
     "Save every member that Plan reads from one decision to the next, and Load them in that order",
     SaveAndLoadContinueToTheBit},
    {"P7", kOfPlanners, Level::kLaws, "refuses saved bytes that are cut",
     "Return the Status of every Read", RefusesBytesThatAreCut},
    {"P8", kOfPlanners, Level::kLaws, "allocates nothing after the first Plan",
     "Size buffers in the constructor or the first Plan and keep them: allocations make the time "
     "of "
     "a decision uneven",
     AllocatesNothingAfterTheFirstPlan},
    {"P9", kOfPlanners, Level::kLaws, "passes on the model's errors and stays of use",
     "Return the Status of every call of the model; BeginEpisode starts afresh",
     PassesOnErrorsOfTheModel},
    {"P10", kOfPlanners, Level::kExtremes, "finds what is not finite",
     "Check what the model answers (CheckFinite in planning.h), and guard against sums that "
     "overflow",
     FindsWhatIsNotFinite},
    {"P11", kOfPlanners, Level::kLaws, "decides alike whatever it is asked to report",
     "Report tree and policy after the action is chosen, without drawing for them",
     ReportingChangesNothing},
    {"P12", kOfPlanners, Level::kLaws, "does what its traits say",
     "Declare the traits that fit (plugin.h): kSearches to call Imagine, kReportsPolicy to report "
     "one",
     DoesWhatItsTraitsSay},
    {"P13", kOfPlanners, Level::kLaws, "asks the model only what model.h allows",
     "Keep actions in [-1, 1], hand back latents as they came, and imagine into other memory than "
     "that of the latents you begin at",
     AsksTheModelAsItShould},
};

}  // namespace

View<const Law> PlannerLaws() { return ViewOf(kLaws); }

void UsePlanner(const Trial& trial, int calls) {
  constexpr int kEpisode = 10;
  PlannerBench bench(trial);
  const Owned<Planner> planner = bench.Make();
  for (int done = 0; done < calls; done += kEpisode) {
    bench.Begin(planner.get());
    Episode(&bench, planner.get(), 11, static_cast<std::uint64_t>(std::min(kEpisode, calls - done)),
            nullptr);
  }
  if (trial.strict()) bench.CheckAnswers();
}

}  // namespace dreamsearch::check
