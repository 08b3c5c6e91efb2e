#include "results/system/file_descriptor.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "results/system/machine_fault.h"

namespace dreamsearch {

void FileDescriptor::Close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

Pipe MakePipe(EmptyPipe when_empty) {
  constexpr int kLeast = 10;
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) throw SystemFailure("make a pipe", errno);
  const Pipe low{FileDescriptor(ends[0]), FileDescriptor(ends[1])};
  Pipe high{FileDescriptor(::fcntl(ends[0], F_DUPFD_CLOEXEC, kLeast)),
            FileDescriptor(::fcntl(ends[1], F_DUPFD_CLOEXEC, kLeast))};
  if (high.read.get() < 0 || high.write.get() < 0) throw SystemFailure("make a pipe", errno);
  if (when_empty == EmptyPipe::kFails) ::fcntl(high.read.get(), F_SETFL, O_NONBLOCK);
  return high;
}

std::string ReadAll(int fd) {
  std::string text;
  char buffer[65536];
  for (;;) {
    const ssize_t got = ::read(fd, buffer, sizeof buffer);
    if (got > 0) {
      text.append(buffer, static_cast<std::size_t>(got));
    } else if (got == 0) {
      return text;
    } else if (errno != EINTR) {
      throw Failure(ExitCode::kInputOutput, std::string("cannot read: ") + std::strerror(errno));
    }
  }
}

bool WriteAll(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written >= 0) {
      bytes.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno != EINTR) {
      return false;
    }
  }
  return true;
}

bool ReaderLeft(int fd) {
  pollfd asked = {.fd = fd, .events = 0, .revents = 0};
  return ::poll(&asked, 1, 0) == 1 && (asked.revents & POLLERR) != 0;
}

}  // namespace dreamsearch
