// joint_model.h - one model that several call at once; their calls are joined.
//
// Whoever works with the model has a *seat*: the model again, behind the same
// interface. Run gives each seat's work a stack of its own, on which plain sequential
// code runs - an agent that plays an episode, a planner that plans one of many roots.
// A call of the seat suspends that work. Once all work that has not ended waits for a
// call, the calls of one kind become one request to the model, and the work that has
// its answer goes on. Of several kinds the one that comes first in a search is answered
// first (PendingCall::Kind in joint_model.cc), so that work which has got out of step
// falls into step again at the next call of the last kind.
//
// By the law of rows (dreamsearch/model.h) every answer has the bits that it has alone.
//
// Threads  one thread drives all seats of a JointModel.
// Errors   where the model refuses a joint request, its parts are asked one by one, so
//          that each seat has the status, too, that it has alone. Failure 70 if
//          there is no room for a stack.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "dreamsearch/model.h"
#include "dreamsearch/planning.h"

namespace dreamsearch {

class JointModel {
 public:
  // Rows of a joint request at most; a single call may have more.
  static constexpr std::uint64_t kMostRows = 512;

  // The model must outlive it.
  JointModel(Model* model, std::size_t seats);
  ~JointModel();
  JointModel(const JointModel&) = delete;
  JointModel& operator=(const JointModel&) = delete;

  std::size_t seats() const { return seats_.size(); }
  // The model as seat i asks it: lives as long as this. Outside of the seat's own work
  // it is the model itself; so are all calls that have no rows to join.
  Model* seat(std::size_t i);

  // Does work(i) for every seat i and returns when all have ended. It must let no
  // exception out and ask no other seat.
  template <typename Work>
  void Run(Work&& work) {
    RunAll([](void* context, std::size_t i) noexcept { (*static_cast<Work*>(context))(i); }, &work);
  }

  // The time that seat i's work has taken: its own, and of every joint request an equal
  // share with those it was joined with. The shares of all seats add up to the time of
  // Run. May be called from that work.
  double Seconds(std::size_t i) const;

 private:
  class Seat;
  struct PendingCall;
  using Call = void (*)(void* context, std::size_t i) noexcept;

  void RunAll(Call call, void* context);
  // Lets seat i's work go on until it asks or ends.
  void Continue(std::size_t i, bool begin);
  // Answers the calls that come next and lets those who asked go on.
  void Answer();
  // Puts them to the model as one; false if it refuses.
  bool AskJointly();

  Model* const model_;
  std::vector<std::unique_ptr<Seat>> seats_;
  Call call_ = nullptr;
  void* context_ = nullptr;
  std::size_t running_;  // the seat whose work goes on, seats() for none
  double slice_began_ = 0;

  // The joint request: the seats that ask, and their rows laid end to end.
  std::vector<std::size_t> asking_;
  LatentBuffer latents_, next_;
  std::vector<double> actions_, observations_, rewards_, discounts_, values_, gradients_;
  std::vector<std::byte> states_;
  std::vector<std::uint64_t> seeds_;
};

}  // namespace dreamsearch
