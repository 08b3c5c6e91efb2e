// file_descriptor.h - file descriptors that close themselves, and whole reads and writes.
#pragma once

#include <string>
#include <string_view>

namespace dreamsearch {

// A file descriptor that closes itself.
class FileDescriptor {
 public:
  explicit FileDescriptor(int fd = -1) : fd_(fd) {}
  ~FileDescriptor() { Close(); }
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(other.Release()) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    if (this != &other) {
      Close();
      fd_ = other.Release();
    }
    return *this;
  }
  int get() const { return fd_; }
  int Release() {
    const int fd = fd_;
    fd_ = -1;
    return fd;
  }
  void Close();

 private:
  int fd_;
};

// Both ends have numbers of 10 and more, above those at which a child expects what it is handed.
struct Pipe {
  FileDescriptor read;
  FileDescriptor write;  // blocking
};
// What reading from an empty pipe does; a child that is handed the end reads as it is.
enum class EmptyPipe { kFails, kBlocks };
// As SystemFailure says.
Pipe MakePipe(EmptyPipe when_empty = EmptyPipe::kFails);

// Reads a descriptor to its end. Throws Failure 74.
std::string ReadAll(int fd);

// Writes all of `bytes`; false if it cannot, errno says why (EPIPE: the reader is gone).
bool WriteAll(int fd, std::string_view bytes);

// Whether `fd` is a pipe or a socket that nobody reads any more, as in `runner --help | head`.
bool ReaderLeft(int fd);

}  // namespace dreamsearch
