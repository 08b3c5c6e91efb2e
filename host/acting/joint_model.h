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
// What seats do that has nothing to do with each other, an environment's step, they do apart: at
// once, on as many threads as there may be.
//
// Threads  one thread drives all seats of a JointModel, but for what they do apart.
// Errors   where the model refuses a joint request, its parts are asked one by one, so
//          that each seat has the status, too, that it has alone. Failure 70 if
//          there is no room for a stack.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
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

  // Does work() of seat i, whose turn it is, while other seats do theirs: one after another unless
  // it has been slow, then on the threads of SetThreads. It must touch nothing that another seat's
  // touches, and ask no seat. Throws what it throws.
  template <typename Work>
  void Apart(std::size_t i, Work&& work) {
    std::exception_ptr fault;
    auto caught = [&work, &fault]() noexcept {
      try {
        work();
      } catch (...) {
        fault = std::current_exception();
      }
    };
    AskApart(
        i, [](void* context) noexcept { (*static_cast<decltype(caught)*>(context))(); }, &caught);
    if (fault != nullptr) std::rethrow_exception(fault);
  }

  // How many threads its model may use, and what seats do apart; 1 until it is told.
  void SetThreads(std::uint32_t threads);

  // The time that seat i's work has taken: its own, and of every joint request an equal
  // share with those it was joined with. The shares of all seats add up to the time of
  // Run. May be called from that work.
  double Seconds(std::size_t i) const;

 private:
  class Seat;
  struct PendingCall;
  using Call = void (*)(void* context, std::size_t i) noexcept;
  using ApartCall = void (*)(void* context) noexcept;

  void RunAll(Call call, void* context);
  void AskApart(std::size_t i, ApartCall call, void* context);
  // Lets seat i's work go on until it asks or ends.
  void Continue(std::size_t i, bool begin);
  // Answers the calls that come next and lets those who asked go on.
  void Answer();
  // Puts them to the model as one; false if it refuses.
  bool AskJointly();
  // Does what they do apart.
  void WorkApart();

  Model* const model_;
  std::vector<std::unique_ptr<Seat>> seats_;
  Call call_ = nullptr;
  void* context_ = nullptr;
  std::size_t running_;  // the seat whose work goes on, seats() for none
  double slice_began_ = 0;
  std::uint32_t threads_ = 1;
  double apart_seconds_ = 0;  // of all that was done apart the last time

  // The joint request: the seats that ask, and their rows laid end to end.
  std::vector<std::size_t> asking_;
  LatentBuffer latents_, next_;
  std::vector<double> actions_, observations_, rewards_, discounts_, values_, gradients_;
  std::vector<std::byte> states_;
  std::vector<std::uint64_t> seeds_;
};

}  // namespace dreamsearch
