// environment_laws.cc - the laws of environment.h, one function each. Over 400 lines: they share
// their subjects.
#include "dreamsearch/random.h"
#include "law.h"
#include "tools.h"

namespace dreamsearch::check {
namespace {

// Steps of an episode that a law plays at most, where it needs no whole one.
constexpr std::uint64_t kSteps = 40;

class EnvironmentBench {
 public:
  explicit EnvironmentBench(const Trial& trial) : trial_(trial) {}

  Owned<Environment> Make() {
    EnvironmentContext context;
    context.parameters = trial_.parameters();
    context.action_repeat = 1;
    NoteCall("the factory");
    Environment* made = nullptr;
    const Status status = trial_.component().create_environment(context, &made);
    return Take(status, made);
  }

  // What a call is looked at for, beside success.
  enum class Look { kNothing, kOutputs, kDeclared };

  void Reset(Environment* environment, std::uint32_t seed, Transcript* transcript = nullptr,
             Look check = Look::kNothing) {
    Guarded<double> observation("the observation", environment->spec().observation_size);
    NoteCall("Reset");
    ExpectOk(environment->Reset(seed, observation.view()), "Reset");
    if (check == Look::kOutputs) {
      observation.CheckGuards();
      observation.CheckSet();
    }
    if (transcript != nullptr) transcript->Add("first observation", observation.view());
  }

  // Steps with actions drawn from `seed`, the index of the first being `first`, until the end of
  // the episode or of `count` steps. Returns whether the episode is over.
  bool Play(Environment* environment, std::uint64_t seed, std::uint64_t first, std::uint64_t count,
            Transcript* transcript = nullptr, Look check = Look::kNothing) {
    const EnvironmentSpec& spec = environment->spec();
    CheckBounds(spec);
    Guarded<double> observation("the observation", spec.observation_size);
    std::vector<double> action(spec.action_size);
    for (std::uint64_t i = first; i < first + count; ++i) {
      Random random(DeriveSeed(seed, i));
      for (std::uint64_t j = 0; j < action.size(); ++j) {
        action[j] = random.Uniform(spec.action_low[j], spec.action_high[j]);
      }
      observation.Unset();
      StepResult result;
      result.reward = kUnset;
      NoteCall("Step, step " + std::to_string(i) + " of an episode");
      const Status status =
          environment->Step({action.data(), action.size()}, observation.view(), &result);
      if (status.code == StatusCode::kDiverged) {
        if (transcript != nullptr) transcript->Add("diverged at step", static_cast<double>(i));
        return true;
      }
      ExpectOk(status, "Step");
      const std::string which = "step " + std::to_string(i) + ", ";
      if (check == Look::kOutputs) {
        observation.CheckGuards();
        observation.CheckSet();
        Expect(std::isfinite(result.reward), "a finite reward at step " + std::to_string(i),
               std::isnan(result.reward) ? "NaN, or it was not set" : "infinity");
      }
      if (check == Look::kDeclared) CheckDiscount(spec, result, i);
      return_ += result.reward;
      if (transcript != nullptr) {
        transcript->Add(which + "observation", observation.view());
        transcript->Add(which + "reward", result.reward);
        transcript->Add(which + "discount", result.discount);
        transcript->Add(which + "last", result.last ? 1 : 0);
      }
      if (result.last) return true;
      Expect(
          check != Look::kDeclared || i + 1 < spec.episode_steps,
          "`last` at step " + std::to_string(spec.episode_steps) + " (episode_steps) at the latest",
          "an episode that goes on");
    }
    return false;
  }

  void ClearReturn() { return_ = 0; }
  double episode_return() const { return return_; }

  static void CheckSpec(const EnvironmentSpec& spec);
  // That there are as many bounds as actions: what reads them asks first.
  static void CheckBounds(const EnvironmentSpec& spec);

 private:
  static void CheckDiscount(const EnvironmentSpec& spec, const StepResult& result,
                            std::uint64_t step) {
    const std::string at = " at step " + std::to_string(step);
    Expect(result.discount == 0 || result.discount == 1, "a discount of 0 (terminal) or 1" + at,
           Number(result.discount));
    if (result.discount != 0) return;
    Expect(result.last, "`last` where the discount is 0" + at, "an episode that goes on");
    Expect(spec.terminates, "a spec that says `terminates` where a discount is 0" + at, "false");
  }

  const Trial& trial_;
  double return_ = 0;
};

void EnvironmentBench::CheckBounds(const EnvironmentSpec& spec) {
  for (const auto& [field, bounds] :
       {std::pair("action_low", spec.action_low), std::pair("action_high", spec.action_high)}) {
    Expect(
        bounds.data != nullptr && bounds.size == spec.action_size,
        std::string(field) + " of action_size = " + std::to_string(spec.action_size) + " numbers",
        std::to_string(bounds.size));
  }
}

void EnvironmentBench::CheckSpec(const EnvironmentSpec& spec) {
  const auto positive = [](const char* field, double value) {
    Expect(std::isfinite(value) && value > 0, std::string(field) + " above 0", Number(value));
  };
  positive("observation_size", static_cast<double>(spec.observation_size));
  positive("action_size", static_cast<double>(spec.action_size));
  positive("control_seconds", spec.control_seconds);
  positive("substeps", spec.substeps);
  positive("episode_steps", spec.episode_steps);
  CheckBounds(spec);
  for (std::uint64_t j = 0; j < spec.action_size; ++j) {
    Expect(std::isfinite(spec.action_low[j]) && std::isfinite(spec.action_high[j]) &&
               spec.action_low[j] < spec.action_high[j],
           "finite action bounds, low below high",
           Number(spec.action_low[j]) + " .. " + Number(spec.action_high[j]));
  }
  std::uint64_t parts = 0;
  std::string names;
  for (const ObservationPart& part : spec.observation) {
    Expect(part.name != nullptr && part.size > 0, "observation parts with a name and a size",
           part.name == nullptr ? "no name" : std::string(part.name) + " of size 0");
    parts += part.size;
    names +=
        (names.empty() ? "" : " + ") + std::string(part.name) + " " + std::to_string(part.size);
  }
  Expect(parts == spec.observation_size,
         "observation parts that add up to observation_size = " +
             std::to_string(spec.observation_size),
         std::to_string(parts) + (names.empty() ? " (no parts)" : " (" + names + ")"));
  Expect(std::isfinite(spec.return_low) && std::isfinite(spec.return_high) &&
             spec.return_low <= spec.return_high,
         "a finite range of returns", Number(spec.return_low) + " .. " + Number(spec.return_high));
}

// --- the laws ----------------------------------------------------------------

// E1
void SaysWhatItIs(const Trial& trial) {
  EnvironmentBench bench(trial);
  const Owned<Environment> environment = bench.Make();
  EnvironmentBench::CheckSpec(environment->spec());
  const EnvironmentSpec before = environment->spec();
  bench.Reset(environment.get(), 1);
  bench.Play(environment.get(), 1, 0, 3);
  const EnvironmentSpec& after = environment->spec();
  EnvironmentBench::CheckSpec(after);
  Expect(before.observation_size == after.observation_size &&
             before.action_size == after.action_size && before.episode_steps == after.episode_steps,
         "a spec that never changes", "other sizes after an episode had begun");
}

// E2: the life cycle of sdk/README.md.
void KeepsTheLifeCycle(const Trial& trial) {
  EnvironmentBench bench(trial);
  bench.Make();
  const Owned<Environment> environment = bench.Make();
  const EnvironmentSpec& spec = environment->spec();
  Guarded<double> observation("the observation", spec.observation_size);
  std::vector<double> action(spec.action_low.begin(), spec.action_low.end());
  StepResult result;
  const View<const double> low{action.data(), action.size()};
  NoteCall("Step before Reset");
  ExpectRefusal(environment->Step(low, observation.view(), &result),
                StatusCode::kFailedPrecondition, "Step before Reset");
  // An episode may be left at any step.
  bench.Reset(environment.get(), 1);
  bench.Reset(environment.get(), 2);
  bench.Play(environment.get(), 1, 0, 2);
  bench.Reset(environment.get(), 3);
  if (!bench.Play(environment.get(), 1, 0, spec.episode_steps)) return;
  NoteCall("Step after the last one");
  ExpectRefusal(environment->Step(low, observation.view(), &result),
                StatusCode::kFailedPrecondition, "Step after the episode's last step");
  bench.Reset(environment.get(), 4);
  bench.Play(environment.get(), 1, 0, 2);
}

// E3
void RefusesOtherSizes(const Trial& trial) {
  EnvironmentBench bench(trial);
  Transcript expected, found;
  {
    const Owned<Environment> unharmed = bench.Make();
    bench.Reset(unharmed.get(), 5, &expected);
    bench.Play(unharmed.get(), 5, 0, 3, &expected);
  }
  const Owned<Environment> environment = bench.Make();
  const EnvironmentSpec& spec = environment->spec();
  bench.Reset(environment.get(), 5, &found);
  Guarded<double> observation("the observation", spec.observation_size + 1);
  std::vector<double> action(spec.action_size + 1, 0);
  std::copy(spec.action_low.begin(), spec.action_low.end(), action.begin());
  StepResult result;
  const View<double> seen{observation.data(), spec.observation_size};
  const View<const double> chosen{action.data(), spec.action_size};
  const auto refuses = [&](const char* what, View<const double> given, View<double> room,
                           StepResult* into) {
    NoteCall(std::string("Step with ") + what);
    ExpectRefusal(environment->Step(given, room, into), StatusCode::kInvalidArgument,
                  std::string("Step with ") + what);
  };
  refuses("one action component too many", {action.data(), spec.action_size + 1}, seen, &result);
  refuses("one action component too few", {action.data(), spec.action_size - 1}, seen, &result);
  refuses("room for a larger observation", chosen, observation.view(), &result);
  for (const double hostile : {kUnset, std::numeric_limits<double>::infinity()}) {
    action[spec.action_size - 1] = hostile;
    refuses(std::isnan(hostile) ? "NaN in the action" : "infinity in the action", chosen, seen,
            &result);
  }
  NoteCall("Reset with room for a larger observation");
  ExpectRefusal(environment->Reset(5, observation.view()), StatusCode::kInvalidArgument,
                "Reset with room for a larger observation");
  observation.CheckGuards();
  // The episode goes on.
  bench.Play(environment.get(), 5, 0, 3, &found);
  found.CheckEquals(expected, "an episode that is unharmed by refused calls");
}

// E4
void SetsEveryOutput(const Trial& trial) {
  using Look = EnvironmentBench::Look;
  EnvironmentBench bench(trial);
  const Owned<Environment> environment = bench.Make();
  for (std::uint32_t seed = 0; seed < 3; ++seed) {
    bench.Reset(environment.get(), seed, nullptr, Look::kOutputs);
    bench.Play(environment.get(), seed, 0, kSteps, nullptr, Look::kOutputs);
  }
}

// E5
void EpisodesAreAsDeclared(const Trial& trial) {
  EnvironmentBench bench(trial);
  const Owned<Environment> environment = bench.Make();
  const EnvironmentSpec& spec = environment->spec();
  for (std::uint32_t seed = 0; seed < 3; ++seed) {
    bench.Reset(environment.get(), seed);
    bench.ClearReturn();
    const bool over = bench.Play(environment.get(), seed, 0, spec.episode_steps, nullptr,
                                 EnvironmentBench::Look::kDeclared);
    Expect(over, "`last` at step " + std::to_string(spec.episode_steps) + " at the latest",
           "an episode that goes on");
    if (spec.return_low == spec.return_high || std::isnan(bench.episode_return())) continue;
    const double slack = 1e-9 * std::max(std::abs(spec.return_low), std::abs(spec.return_high));
    Expect(bench.episode_return() >= spec.return_low - slack &&
               bench.episode_return() <= spec.return_high + slack,
           "returns in the declared range, " + Number(spec.return_low) + " .. " +
               Number(spec.return_high),
           Number(bench.episode_return()) + " with random actions");
  }
}

// E6
void ResetObeysItsSeed(const Trial& trial) {
  EnvironmentBench bench(trial);
  const Owned<Environment> first = bench.Make(), second = bench.Make();
  Transcript expected;
  bench.Reset(first.get(), 7, &expected);
  bench.Play(first.get(), 7, 0, kSteps, &expected);
  const auto again = [&](Environment* environment, const char* promise) {
    Transcript found;
    bench.Reset(environment, 7, &found);
    bench.Play(environment, 7, 0, kSteps, &found);
    found.CheckEquals(expected, promise);
  };
  again(first.get(), "the same episode again with the same seed and actions");
  bench.Reset(first.get(), 99);
  bench.Play(first.get(), 99, 0, 5);
  again(first.get(), "the same episode after another one was left");
  again(second.get(), "the same episode in a second environment");
  Transcript other;
  bench.Reset(first.get(), 8, &other);
  bench.Play(first.get(), 7, 0, kSteps, &other);
  if (other.Equals(expected)) Remark("seeds 7 and 8 give the same episode");
}

// E7
void InstancesShareNothing(const Trial& trial) {
  EnvironmentBench bench(trial);
  Transcript expected, found;
  {
    const Owned<Environment> alone = bench.Make();
    bench.Reset(alone.get(), 7, &expected);
    bench.Play(alone.get(), 7, 0, kSteps, &expected);
  }
  const Owned<Environment> other = bench.Make(), environment = bench.Make();
  bench.Reset(environment.get(), 7, &found);
  bench.Reset(other.get(), 50);
  bool over = false;
  for (std::uint64_t i = 0; i < kSteps && !over; ++i) {
    if (bench.Play(other.get(), 50, i, 1)) bench.Reset(other.get(), 51);
    over = bench.Play(environment.get(), 7, i, 1, &found);
  }
  found.CheckEquals(expected, "an environment that steps in turn with another one as alone");
}

// E8
void SavesItsWholeState(const Trial& trial) {
  EnvironmentBench bench(trial);
  const Owned<Environment> environment = bench.Make(), other = bench.Make();
  auto* saving = ExtensionOf<StateSaving>(environment.get());
  if (saving == nullptr) Skip("it does not offer StateSaving");
  const std::uint64_t bytes = saving->state_bytes();
  Expect(bytes > 0, "a state of at least one byte", "0");
  Guarded<std::byte> state("the saved state", bytes);
  for (const std::uint64_t at : {0, 1, 7, 20}) {
    bench.Reset(environment.get(), 3);
    if (bench.Play(environment.get(), 3, 0, at)) break;
    state.Unset();
    NoteCall("SaveState");
    ExpectOk(saving->SaveState(state.view()), "SaveState");
    state.CheckGuards();
    Transcript expected;
    bench.Play(environment.get(), 3, at, kSteps, &expected);
    // Into itself after it went on, into another one in the middle of an episode, and into a new
    // one before any.
    bench.Reset(other.get(), 88);
    bench.Play(other.get(), 88, 0, 3);
    const Owned<Environment> fresh = bench.Make();
    const std::pair<Environment*, const char*> into[] = {
        {environment.get(), "itself"},
        {other.get(), "another one in the middle of an episode"},
        {fresh.get(), "a new one before its first episode"}};
    for (const auto& [restored, what] : into) {
      NoteCall("RestoreState");
      ExpectOk(ExtensionOf<StateSaving>(restored)->RestoreState(state.view()),
               std::string("RestoreState into ") + what);
      Transcript found;
      bench.Play(restored, 3, at, kSteps, &found);
      found.CheckEquals(expected, "the bits of going on, from the state of step " +
                                      std::to_string(at) + " restored into " + what);
    }
  }
  NoteCall("RestoreState of another size");
  ExpectRefusal(saving->RestoreState({state.data(), bytes - 1}), StatusCode::kDataLoss,
                "RestoreState of one byte too few");
}

// E9
void SurvivesHugeActions(const Trial& trial) {
  EnvironmentBench bench(trial);
  const Owned<Environment> environment = bench.Make();
  const EnvironmentSpec& spec = environment->spec();
  Guarded<double> observation("the observation", spec.observation_size);
  for (const double hostile : {1e3, -1e3, 1e300, -1e300}) {
    bench.Reset(environment.get(), 1);
    std::vector<double> action(spec.action_size, hostile);
    for (int i = 0; i < 10; ++i) {
      StepResult result;
      observation.Unset();
      NoteCall("Step with an action of " + Number(hostile));
      const Status status =
          environment->Step({action.data(), action.size()}, observation.view(), &result);
      if (!status.ok()) {
        Expect(status.code == StatusCode::kInvalidArgument ||
                   status.code == StatusCode::kDiverged ||
                   status.code == StatusCode::kFailedPrecondition,
               "an action out of bounds clipped, refused or diverged", Text(status));
        break;
      }
      observation.CheckSet();
      Expect(std::isfinite(result.reward), "a finite reward or an error", Number(result.reward));
      if (result.last) break;
    }
  }
  bench.Reset(environment.get(), 1);
  bench.Play(environment.get(), 1, 0, 3);
}

constexpr Law kLaws[] = {
    {"E1", kOfEnvironments, Level::kLaws, "its spec is complete, adds up and never changes",
     "Correct the EnvironmentSpec: models are sized by it, and the host maps actions with its "
     "bounds",
     SaysWhatItIs},
    {"E2", kOfEnvironments, Level::kLaws, "keeps the life cycle",
     "See the table of the life cycle in sdk/README.md: remember whether an episode is under way",
     KeepsTheLifeCycle},
    {"E3", kOfEnvironments, Level::kLaws,
     "refuses other sizes and actions that are not finite, unharmed",
     "Compare sizes and look for NaN and infinity before anything is changed", RefusesOtherSizes},
    {"E4", kOfEnvironments, Level::kLaws, "sets every output and writes nothing beside its views",
     "Fill the whole observation and result->reward in every Step, and the observation in Reset",
     SetsEveryOutput},
    {"E5", kOfEnvironments, Level::kLaws,
     "episodes end, and rewards, discounts and returns are as declared",
     "Set `last` at episode_steps; a discount is 0 at a terminal state (declare `terminates`) and "
     "1 "
     "elsewhere; declare the range that returns really have, or equal ends for none",
     EpisodesAreAsDeclared},
    {"E6", kOfEnvironments, Level::kLaws, "Reset obeys its seed",
     "Make every random generator anew from the seed in Reset, and reset every member that Step "
     "reads",
     ResetObeysItsSeed},
    {"E7", kOfEnvironments, Level::kLaws, "the order and number of instances do not matter",
     "Keep state in members, never in static or thread_local variables", InstancesShareNothing},
    {"E8", kOfEnvironments, Level::kLaws, "a saved state is the whole state",
     "Save every member that Step reads or writes: velocities, counters, warm starts, the "
     "generator; "
     "or do not offer StateSaving",
     SavesItsWholeState},
    {"E9", kOfEnvironments, Level::kExtremes, "survives huge actions",
     "Clip actions to the bounds, or refuse them; report a simulator that diverged as kDiverged",
     SurvivesHugeActions},
};

}  // namespace

View<const Law> EnvironmentLaws() { return ViewOf(kLaws); }

void UseEnvironment(const Trial& trial, int calls) {
  EnvironmentBench bench(trial);
  const Owned<Environment> environment = bench.Make();
  bench.Reset(environment.get(), 1);
  bench.Play(environment.get(), 1, 0, static_cast<std::uint64_t>(calls), nullptr,
             trial.strict() ? EnvironmentBench::Look::kOutputs : EnvironmentBench::Look::kNothing);
  bench.Reset(environment.get(), 2);
}

}  // namespace dreamsearch::check
