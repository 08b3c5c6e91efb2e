// activity_clock.h - what a run's time went to.
//
// At every moment exactly one activity is charged, so the activities add up to
// the wall time by construction. So do the processor times of all threads: learning and
// evaluation, which may use several, are charged with their own; what the process used between
// two of them is shared among the activities there by their wall time. Times are recorded,
// never acted on.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <ctime>

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
  using Numbers = std::array<double, kActivities>;
  // Of each activity, earlier segments included.
  struct Use {
    Numbers seconds{};            // of wall time
    Numbers processor_seconds{};  // of all threads
    Numbers gflop{};              // what those could have computed
  };

  // Time before `since`, a moment of Now(), is not charged. A processor second counts as
  // gflop_per_second.
  explicit ActivityClock(double since, double gflop_per_second = 0)
      : since_(since), gflop_per_second_(gflop_per_second), processor_since_(ProcessorNow()) {}

  // Charges the time since the last switch to the activity under way, and goes on
  // with `next`. Returns the activity that was under way.
  Activity Switch(Activity next) {
    const double now = Now();
    use_.seconds[static_cast<std::size_t>(current_)] += now - since_;
    unsettled_[static_cast<std::size_t>(current_)] += now - since_;
    since_ = now;
    if (MayUseThreads(current_) || MayUseThreads(next)) Settle();
    const Activity before = current_;
    current_ = next;
    return before;
  }

  // Totals up to now.
  const Use& Totals() {
    Switch(current_);
    Settle();
    return use_;
  }
  void set_totals(const Use& use) { use_ = use; }

  static double Now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }

  // Processor time of all threads of this process.
  static double ProcessorNow() {
    std::timespec time{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  }

 private:
  static bool MayUseThreads(Activity activity) {
    return activity == Activity::kLearning || activity == Activity::kEvaluation;
  }

  // Shares the processor time since the last call by the wall time since then.
  void Settle() {
    const double now = ProcessorNow();
    double wall = 0;
    for (const double seconds : unsettled_) wall += seconds;
    for (std::size_t i = 0; i < kActivities && wall > 0; ++i) {
      const double share = (now - processor_since_) * unsettled_[i] / wall;
      use_.processor_seconds[i] += share;
      use_.gflop[i] += share * gflop_per_second_;
      unsettled_[i] = 0;
    }
    if (wall > 0) processor_since_ = now;
  }

  Use use_;
  double since_;
  double gflop_per_second_;
  double processor_since_;
  Numbers unsettled_{};  // wall time since then
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
