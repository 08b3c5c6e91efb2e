// activity_clock.h - what a run's wall time went to.
//
// At every moment exactly one activity is charged, so the activities add up to
// the wall time by construction. Times are recorded, never acted on.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>

#include "results/database/schema.h"

namespace dreamsearch {

enum class Activity : std::size_t {
  kEnvironment = 0,
  kPlanning = 1,  // with the posterior update
  kLearning = 2,
  kEvaluation = 3,
  kRecording = 4,  // database and checkpoints
  kOther = 5,      // loading, and what belongs to none
};
// Their names, in this order, are results::kActivities.
inline constexpr std::size_t kActivities = results::kActivities.size();

class ActivityClock {
 public:
  using Seconds = std::array<double, kActivities>;

  // Time before `since`, a moment of Now(), is not charged.
  explicit ActivityClock(double since) : since_(since) {}

  // Charges the time since the last switch to the activity under way, and goes on
  // with `next`. Returns the activity that was under way.
  Activity Switch(Activity next) {
    const double now = Now();
    seconds_[static_cast<std::size_t>(current_)] += now - since_;
    since_ = now;
    const Activity before = current_;
    current_ = next;
    return before;
  }

  // Totals up to now, earlier segments included.
  const Seconds& Totals() {
    Switch(current_);
    return seconds_;
  }
  void set_totals(const Seconds& seconds) { seconds_ = seconds; }

  static double Now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }

 private:
  Seconds seconds_{};
  double since_;
  Activity current_ = Activity::kOther;
};

// Charges an activity while it lives, then goes back to the one before.
class ActivityScope {
 public:
  ActivityScope(ActivityClock* clock, Activity activity)
      : clock_(clock), before_(clock->Switch(activity)) {}
  ~ActivityScope() { clock_->Switch(before_); }
  ActivityScope(const ActivityScope&) = delete;
  ActivityScope& operator=(const ActivityScope&) = delete;

 private:
  ActivityClock* clock_;
  Activity before_;
};

}  // namespace dreamsearch
