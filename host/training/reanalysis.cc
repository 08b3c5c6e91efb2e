#include "host/training/reanalysis.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dreamsearch/random.h"
#include "host/acting/agent.h"
#include "host/settings/seeds.h"
#include "results/system/error.h"

namespace dreamsearch {
namespace {

// States that an update can have to plan anew.
std::uint64_t MostRoots(const RunSpec& spec) {
  const double states =
      static_cast<double>(spec.run.Integer("batch_size") * spec.run.Integer("sequence_length"));
  return static_cast<std::uint64_t>(std::ceil(spec.run.Number("reanalyse") * states)) + 1;
}

}  // namespace

Reanalysis::Reanalysis(const RunSpec& spec, const Components& components, Model* model)
    : spec_(spec),
      model_(model),
      model_text_("model '" + spec.model.name() + "'"),
      planner_text_("planner '" + spec.planner.name() + "'"),
      share_(spec.run.Number("reanalyse")),
      joint_(model, std::min(kMostRoots, MostRoots(spec))),
      seats_(joint_.seats()) {
  const std::uint64_t candidates = spec.search_candidates(), actions = model->action_size();
  for (std::size_t i = 0; i < seats_.size(); ++i) {
    Seat& seat = seats_[i];
    seat.planner = components.MakePlanner(*joint_.seat(i));
    seat.proxy = std::make_unique<ModelProxy>(joint_.seat(i), spec.model.name(),
                                              spec.planner.Has(kSearches));
    seat.action.resize(actions);
    seat.metrics.resize(spec.planner.info->metrics.size());
    seat.policy_actions.resize(candidates * actions);
    seat.policy_weights.resize(candidates);
  }
}

std::uint64_t Reanalysis::Seed(std::uint64_t update, std::uint64_t draw) const {
  return SeedFor(spec_.seed, SeedUse::kReanalyse, EpisodePurpose::kTraining, update, draw);
}

void Reanalysis::Choose(std::uint64_t rows, std::uint64_t update) {
  const double each = share_ * static_cast<double>(rows);
  const auto until = [&](std::uint64_t updates) {
    return static_cast<std::uint64_t>(each * static_cast<double>(updates));
  };
  chosen_.resize(std::min(rows, until(update + 1) - until(update)));
  rows_.resize(rows);
  std::iota(rows_.begin(), rows_.end(), std::uint64_t{0});
  Random random(Seed(update, 0));
  for (std::size_t i = 0; i < chosen_.size(); ++i) {
    std::swap(rows_[i], rows_[i + random.Below(rows - i)]);
    chosen_[i] = rows_[i];
  }
  std::sort(chosen_.begin(), chosen_.end());
}

void Reanalysis::Believe(const SequenceBatch& batch, std::uint64_t update) {
  const std::uint64_t bytes = model_->latent_bytes(), length = batch.length;
  const std::uint64_t a = batch.actions.cols, o = batch.observations.cols;
  sequences_.clear();
  std::uint64_t end = 0;  // of the times that lead to a chosen row
  for (const std::uint64_t row : chosen_) {
    if (sequences_.empty() || sequences_.back() != row / length) {
      sequences_.push_back(row / length);
    }
    end = std::max(end, row % length + 1);
  }
  const std::uint64_t count = sequences_.size();
  if (roots_.rows() < chosen_.size()) roots_ = LatentBuffer(chosen_.size(), bytes);
  if (next_.rows() < count) {
    previous_ = LatentBuffer(count, bytes);
    next_ = LatentBuffer(count, bytes);
  }
  seeds_.resize(count);
  actions_.resize(count * a);
  observations_.resize(count * o);
  for (std::uint64_t t = 0; t < end; ++t) {
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::uint64_t row = sequences_[i] * length + t;
      if (t > 0 && batch.is_first[row] == 0) {
        previous_.Set(i, next_.row(i));
      } else {
        ThrowUnlessOk(model_->InitialLatent(previous_.row(i)), model_text_ + " InitialLatent");
      }
      std::copy_n(batch.actions.row(row).data, a, actions_.data() + i * a);
      std::copy_n(batch.observations.row(row).data, o, observations_.data() + i * o);
      seeds_[i] = Seed(update, 1 + 2 * row);
    }
    ObserveRequest request;
    request.previous = previous_.middle_rows(0, count);
    request.actions = {actions_.data(), count, a};
    request.observations = {observations_.data(), count, o};
    request.seeds = {seeds_.data(), count};
    ThrowUnlessOk(model_->Observe(request, next_.middle_rows(0, count)), model_text_ + " Observe");
    for (std::uint64_t i = 0, at = 0; i < chosen_.size(); ++i) {
      while (sequences_[at] != chosen_[i] / length) ++at;
      if (chosen_[i] % length == t) roots_.Set(i, next_.row(at));
    }
  }
}

void Reanalysis::Renew(const SequenceBatch& batch, std::uint64_t update,
                       std::uint64_t environment_step, Replay* replay) {
  Choose(batch.sequences * batch.length, update);
  if (chosen_.empty()) return;
  Believe(batch, update);
  for (std::uint64_t first = 0; first < chosen_.size(); first += seats_.size()) {
    const std::uint64_t count = std::min<std::uint64_t>(seats_.size(), chosen_.size() - first);
    joint_.Run([&](std::size_t i) {
      if (i >= count) return;
      Seat& seat = seats_[i];
      const std::uint64_t row = chosen_[first + i];
      PlanResult& result = seat.result.emplace();
      result.action = {seat.action.data(), seat.action.size()};
      result.metrics = {seat.metrics.data(), seat.metrics.size()};
      PlanRequest request;
      request.root = roots_.row(first + i);
      request.explore = true;
      request.seed = Seed(update, 2 + 2 * row);
      request.decision = replay->DecisionOf(row);
      request.environment_step = environment_step;
      seat.status = seat.planner->BeginEpisode(seat.proxy.get());
      if (seat.status.ok()) seat.status = seat.planner->Plan(request, &result);
      if (!seat.status.ok()) return;
      seat.status = ExtensionOf<PolicyReporting>(seat.planner.get())
                        ->ReportPolicy(seat.policy(), seat.weights());
    });
    const std::string who = planner_text_ + " Plan of a sampled state";
    for (std::uint64_t i = 0; i < count; ++i) {
      Seat& seat = seats_[i];
      ThrowUnlessOk(seat.proxy->fault(), who);
      ThrowUnlessOk(seat.status, who);
      CheckPlanned(planner_text_, replay->DecisionOf(chosen_[first + i]), *seat.result);
      CheckPolicy(planner_text_, seat.policy(), seat.weights());
      replay->RenewSearch(chosen_[first + i], {seat.policy(), seat.weights(), seat.result->value});
    }
  }
}

}  // namespace dreamsearch
