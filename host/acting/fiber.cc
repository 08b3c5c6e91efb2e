#include "host/acting/fiber.h"

#include <cxxabi.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cassert>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>

#include "results/system/error.h"

#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/common_interface_defs.h>
#endif
#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace dreamsearch {

Fiber::Fiber() : page_(static_cast<std::size_t>(::sysconf(_SC_PAGESIZE))) {
  void* memory = ::mmap(nullptr, page_ + kStackBytes, PROT_NONE,
                        MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE | MAP_STACK, -1, 0);
  if (memory == MAP_FAILED) {
    throw Failure(ExitCode::kInternal,
                  std::string("no room for the stack of a planner: ") + std::strerror(errno));
  }
  memory_ = static_cast<std::byte*>(memory);
  if (::mprotect(memory_ + page_, kStackBytes, PROT_READ | PROT_WRITE) != 0) {
    const int error = errno;
    ::munmap(memory_, page_ + kStackBytes);
    throw Failure(ExitCode::kInternal,
                  std::string("no room for the stack of a planner: ") + std::strerror(error));
  }
#ifdef __SANITIZE_THREAD__
  sanitizer_fiber_ = __tsan_create_fiber(0);
#endif
}

Fiber::~Fiber() {
#ifdef __SANITIZE_THREAD__
  __tsan_destroy_fiber(sanitizer_fiber_);
#endif
  ::munmap(memory_, page_ + kStackBytes);
}

void Fiber::Start(Body body, void* context) {
  assert(ended_);
  body_ = body;
  context_ = context;
  ended_ = false;
  exceptions_ = {};
  site_ = {};
  sanitizer_state_ = nullptr;
  begun_ = false;
  ::getcontext(&entry_);
  entry_.uc_stack.ss_sp = memory_ + page_;
  entry_.uc_stack.ss_size = kStackBytes;
  entry_.uc_link = nullptr;
  // makecontext passes ints.
  const auto self = reinterpret_cast<std::uintptr_t>(this);
  ::makecontext(&entry_, reinterpret_cast<void (*)()>(&Fiber::Enter), 2,
                static_cast<unsigned int>(self), static_cast<unsigned int>(self >> 32));
  SwitchIn();
}

void Fiber::Resume() {
  assert(!ended_);
  SwitchIn();
}

void Fiber::Pause() { SwitchOut(); }

void Fiber::Enter(unsigned int low, unsigned int high) {
  auto* self = reinterpret_cast<Fiber*>(static_cast<std::uintptr_t>(high) << 32 | low);
#ifdef __SANITIZE_ADDRESS__
  __sanitizer_finish_switch_fiber(nullptr, &self->resumer_stack_, &self->resumer_stack_bytes_);
#endif
  self->body_(self->context_);
  self->ended_ = true;
  self->SwitchOut();
}

namespace {

// The runtime's record and the one given change places.
template <typename Record>
void SwapExceptions(Record* record) {
  Record now;
  void* runtime = abi::__cxa_get_globals();
  std::memcpy(&now, runtime, sizeof now);
  std::memcpy(runtime, record, sizeof now);
  *record = now;
}

}  // namespace

void Fiber::SwitchIn() {
  SwapExceptions(&exceptions_);
  std::swap(call_site, site_);
  if (_setjmp(resumer_) == 0) {
#ifdef __SANITIZE_ADDRESS__
    __sanitizer_start_switch_fiber(&sanitizer_resumer_state_, memory_ + page_, kStackBytes);
#endif
#ifdef __SANITIZE_THREAD__
    sanitizer_resumer_ = __tsan_get_current_fiber();
    __tsan_switch_to_fiber(sanitizer_fiber_, 0);
#endif
    if (begun_) _longjmp(own_, 1);
    begun_ = true;
    ::setcontext(&entry_);
  }
#ifdef __SANITIZE_ADDRESS__
  __sanitizer_finish_switch_fiber(sanitizer_resumer_state_, nullptr, nullptr);
#endif
  SwapExceptions(&exceptions_);
  std::swap(call_site, site_);
}

void Fiber::SwitchOut() {
  if (_setjmp(own_) == 0) {
#ifdef __SANITIZE_ADDRESS__
    // One that has ended gives up what the sanitizer keeps of its stack.
    __sanitizer_start_switch_fiber(ended_ ? nullptr : &sanitizer_state_, resumer_stack_,
                                   resumer_stack_bytes_);
#endif
#ifdef __SANITIZE_THREAD__
    __tsan_switch_to_fiber(sanitizer_resumer_, 0);
#endif
    _longjmp(resumer_, 1);
  }
#ifdef __SANITIZE_ADDRESS__
  __sanitizer_finish_switch_fiber(sanitizer_state_, &resumer_stack_, &resumer_stack_bytes_);
#endif
}

}  // namespace dreamsearch
