#include "host/films/film_writer.h"

#include <signal.h>
#include <spawn.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <utility>
#include <vector>

#include "host/processes/child_process.h"
#include "results/system/child.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/file_descriptor.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

std::string_view Bytes(const Picture& picture) {
  return {reinterpret_cast<const char*>(picture.rgb.data()), picture.rgb.size()};
}

// A video by ffmpeg, which reads raw pictures from a pipe.
class Video final : public FilmWriter {
 public:
  Video(const std::string& path, double frames_per_second)
      : path_(AbsolutePath(path)), frames_per_second_(frames_per_second) {
    const std::filesystem::path file(path_);
    // ffmpeg tells the format by the ending.
    temporary_ = (file.parent_path() / ("." + file.stem().string() + "." +
                                        std::to_string(::getpid()) + file.extension().string()))
                     .string();
  }
  ~Video() override {
    if (pid_ > 0) {
      pipe_.Close();
      ::kill(pid_, SIGKILL);
      WaitForEnd(pid_);
    }
    std::error_code ignored;
    std::filesystem::remove(temporary_, ignored);
  }

  void Add(const Picture& picture) override {
    if (pid_ < 0) Start(picture);
    if (!WriteAll(pipe_.get(), Bytes(picture))) Fail();
  }

  void Finish() override {
    if (pid_ < 0) return;
    pipe_.Close();
    if (Wait() != 0) Fail();
    std::error_code error;
    std::filesystem::rename(temporary_, path_, error);
    if (error) throw Failure(ExitCode::kCannotCreate, path_ + ": " + error.message());
  }

 private:
  void Start(const Picture& picture) {
    const std::string size = std::to_string(picture.width) + "x" + std::to_string(picture.height);
    const std::string rate = FormatNumber("%.6g", frames_per_second_);
    std::vector<std::string> words = {"ffmpeg",   "-hide_banner", "-loglevel", "error", "-f",
                                      "rawvideo", "-pix_fmt",     "rgb24",     "-s",    size,
                                      "-r",       rate,           "-i",        "-",     "-an"};
    const std::string ending = std::filesystem::path(path_).extension().string();
    std::vector<std::string> how;
    if (ending == ".gif") {
      how = {"-filter_complex", "split[a][b];[a]palettegen[p];[b][p]paletteuse"};
    } else if (ending == ".webm") {
      how = {"-c:v", "libvpx-vp9", "-pix_fmt", "yuv420p", "-crf", "32", "-b:v", "0"};
    } else {
      // What every browser plays.
      how = {"-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "23", "-movflags", "+faststart"};
    }
    words.insert(words.end(), how.begin(), how.end());
    words.insert(words.end(), {"-y", temporary_});
    std::vector<char*> argv = ArgumentVector(&words);

    messages_ = MemoryFile("");
    Pipe pipe = MakePipe(EmptyPipe::kBlocks);
    pipe_ = std::move(pipe.write);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, pipe.read.get(), 0);
    posix_spawn_file_actions_adddup2(&actions, messages_.get(), 1);
    posix_spawn_file_actions_adddup2(&actions, messages_.get(), 2);
    const int error = ::posix_spawnp(&pid_, "ffmpeg", &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error == 0) return;
    pid_ = -1;
    throw Failure(ExitCode::kNotFound,
                  std::string("ffmpeg, which makes videos, cannot be started: ") +
                      std::strerror(error) +
                      ". Install the package ffmpeg, or write pictures: --out SHEET.png, "
                      "--out FOLDER/");
  }

  int Wait() { return WaitForEnd(std::exchange(pid_, -1)); }

  [[noreturn]] void Fail() {
    pipe_.Close();
    if (pid_ > 0) Wait();
    ::lseek(messages_.get(), 0, SEEK_SET);
    std::string said = ReadAll(messages_.get());
    while (!said.empty() && said.back() == '\n') said.pop_back();
    throw Failure(ExitCode::kCannotCreate,
                  path_ + ": ffmpeg made no video" + (said.empty() ? "" : ": " + said));
  }

  const std::string path_;
  const double frames_per_second_;
  std::string temporary_;
  FileDescriptor pipe_, messages_;
  pid_t pid_ = -1;
};

class Sheet final : public FilmWriter {
 public:
  explicit Sheet(std::string path) : path_(std::move(path)) {}
  void Add(const Picture& picture) override { sheet_.Add(picture); }
  void Finish() override { WriteFile(path_, PngOf(Grid(sheet_.Chosen(), kColumns))); }

 private:
  static constexpr int kColumns = 4, kRows = 3;
  const std::string path_;
  PictureSheet sheet_{std::size_t{kColumns} * kRows};
};

class Folder final : public FilmWriter {
 public:
  explicit Folder(std::string path) : path_(std::move(path)) {
    std::error_code error;
    std::filesystem::create_directories(path_, error);
    if (error) throw Failure(ExitCode::kCannotCreate, path_ + ": " + error.message());
  }
  void Add(const Picture& picture) override {
    char name[32];
    std::snprintf(name, sizeof name, "frame-%06zu.png", ++written_);
    WriteFile((std::filesystem::path(path_) / name).string(), PngOf(picture));
  }
  void Finish() override {}

 private:
  const std::string path_;
  std::size_t written_ = 0;
};

bool IsFolder(const std::string& path) {
  return path.ends_with('/') || std::filesystem::is_directory(path);
}

}  // namespace

void FilmWriter::CheckPath(const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  for (const char* known : {".mp4", ".webm", ".gif", ".png"}) {
    if (ending == known) return;
  }
  if (IsFolder(path)) return;
  throw Failure(ExitCode::kUsage,
                "--out: expected a video (.mp4, .webm, .gif), a sheet of pictures (.png) or a "
                "folder for pictures (FOLDER/), found '" +
                    path + "'");
}

std::unique_ptr<FilmWriter> FilmWriter::Make(const std::string& path, double frames_per_second) {
  CheckPath(path);
  if (IsFolder(path)) return std::make_unique<Folder>(path);
  if (path.ends_with(".png")) return std::make_unique<Sheet>(path);
  return std::make_unique<Video>(path, frames_per_second);
}

void PictureSheet::Add(const Picture& picture) {
  last_ = picture;
  if (seen_++ % stride_ != 0) return;
  kept_.push_back(picture);
  if (kept_.size() < 4 * wanted_) return;
  for (std::size_t i = 1; 2 * i < kept_.size(); ++i) kept_[i] = std::move(kept_[2 * i]);
  kept_.resize((kept_.size() + 1) / 2);
  stride_ *= 2;
}

std::vector<Picture> PictureSheet::Chosen() const {
  std::vector<Picture> all = kept_;
  if (!all.empty() && (seen_ - 1) % stride_ != 0) all.push_back(last_);
  if (all.size() <= wanted_) return all;
  std::vector<Picture> chosen;
  for (std::size_t i = 0; i < wanted_; ++i) {
    chosen.push_back(all[i * (all.size() - 1) / (wanted_ - 1)]);
  }
  return chosen;
}

}  // namespace dreamsearch
