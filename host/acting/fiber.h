// fiber.h - a function that can pause: it runs on a stack of its own.
//
// Memory   a stack of kStackBytes of address space, of which only what is touched takes
//          memory, above a page that may not be touched: one that overflows is a
//          segmentation fault, as on a thread's stack.
// Threads  a fiber is resumed on the thread that started it. Thread-local state is that of
//          the thread; what C++ keeps there of exceptions under way is a fiber's own.
// Errors   Failure 70 if the system has no room for a stack.
#pragma once

#include <ucontext.h>

#include <csetjmp>
#include <cstddef>

#include "host/plugins/call_site.h"

namespace dreamsearch {

class Fiber {
 public:
  static constexpr std::size_t kStackBytes = std::size_t{8} << 20;
  using Body = void (*)(void* context) noexcept;

  Fiber();
  // What lives on the stack of one that has not ended is never destroyed.
  ~Fiber();
  Fiber(const Fiber&) = delete;
  Fiber& operator=(const Fiber&) = delete;

  // Runs body(context) until it pauses or ends. The fiber before has ended.
  void Start(Body body, void* context);
  // Goes on after Pause, until the next one or the end.
  void Resume();
  // Of the fiber that is running, on its own stack: back to whoever resumed it.
  void Pause();

  bool ended() const { return ended_; }

 private:
  // What the C++ runtime keeps of exceptions under way (Itanium C++ ABI, 2.2.2).
  struct Exceptions {
    void* caught = nullptr;
    unsigned int uncaught = 0;
  };

  static void Enter(unsigned int low, unsigned int high);
  // Onto its stack and off it. Contexts make the stack, jumps change it: a context brings
  // the signal mask along, two system calls a switch, which would be a tenth of a search.
  void SwitchIn();
  void SwitchOut();

  std::byte* memory_ = nullptr;  // the forbidden page, then the stack
  std::size_t page_ = 0;
  ucontext_t entry_{};  // where the body begins
  std::jmp_buf own_;    // where it goes on
  std::jmp_buf resumer_;
  Body body_ = nullptr;
  void* context_ = nullptr;
  bool begun_ = false;
  bool ended_ = true;
  Exceptions exceptions_;  // of the side that is not running
  CallSite site_;          // likewise
  // What sanitizers want to know of the stacks.
  void* sanitizer_state_ = nullptr;
  void* sanitizer_resumer_state_ = nullptr;
  const void* resumer_stack_ = nullptr;
  std::size_t resumer_stack_bytes_ = 0;
  void* sanitizer_fiber_ = nullptr;
  void* sanitizer_resumer_ = nullptr;
};

}  // namespace dreamsearch
