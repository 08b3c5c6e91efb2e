#include "host/processes/crash_report.h"

#include <execinfo.h>
#include <signal.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>

#include "host/plugins/call_site.h"

namespace dreamsearch {
namespace {

constexpr int kSignals[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
constexpr unsigned kMostSeconds = 5;  // for the report itself
constexpr std::size_t kStackBytes = 64 << 10;
alignas(16) char report_stack[kStackBytes];

// A line made of pieces, without memory of the heap.
class Line {
 public:
  void Add(const char* text) {
    while (*text != '\0' && size_ < sizeof text_ - 1) text_[size_++] = *text++;
  }
  void Add(std::uint64_t number) {
    char digits[20];
    std::size_t count = 0;
    do {
      digits[count++] = static_cast<char>('0' + number % 10);
    } while ((number /= 10) != 0);
    while (count > 0 && size_ < sizeof text_ - 1) text_[size_++] = digits[--count];
  }
  void Write() {
    text_[size_++] = '\n';
    if (::write(STDERR_FILENO, text_, size_) < 0) return;  // nobody is left to be told
  }

 private:
  char text_[512];
  std::size_t size_ = 0;
};

// Only what a signal handler may call: a plugin's fault may lie inside malloc.
void ReportSite(const CallSite& site) {
  Line line;
  line.Add("\n");
  line.Add(kCrashMark);
  if (site.name == nullptr) {
    line.Add("no component's call");
  } else {
    if (site.kind[0] != '\0') {
      line.Add(site.kind);
      line.Add(" '");
    }
    line.Add(site.name);
    if (site.kind[0] != '\0') line.Add("'");
    line.Add(" ");
    line.Add(site.call);
    if (site.counted[0] != '\0') {
      line.Add(", ");
      line.Add(site.counted);
      line.Add(" ");
      line.Add(site.number);
    }
  }
  line.Write();
}

void Report(int signal) {
  ::alarm(kMostSeconds);
  ReportSite(CallSiteUnderWay());
  void* frames[64];
  const int count = ::backtrace(frames, 64);
  ::backtrace_symbols_fd(frames, count, STDERR_FILENO);
  ::alarm(0);
  ::raise(signal);  // which has its default action again
}

void ReportExit() {
  if (call_site.name != nullptr) ReportSite(call_site);
}

}  // namespace

void ReportCrashes() {
  std::atexit(ReportExit);
  // The first backtrace loads a library, which allocates.
  void* frame = nullptr;
  ::backtrace(&frame, 1);
  stack_t stack = {};
  stack.ss_sp = report_stack;
  stack.ss_size = sizeof report_stack;
  ::sigaltstack(&stack, nullptr);
  struct sigaction action = {};
  action.sa_handler = Report;
  action.sa_flags = static_cast<int>(SA_ONSTACK | SA_RESETHAND | SA_NODEFER);
  for (const int signal : kSignals) ::sigaction(signal, &action, nullptr);
}

}  // namespace dreamsearch
