// filmed_episode.h - an evaluation episode, picture by picture.
//
// The episode is played by a child process, as everything that loads plugins; its frames come
// through a pipe, so that a film of any length takes little memory, and several episodes can be
// shown side by side.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "dreamsearch/environment.h"
#include "host/films/picture.h"
#include "host/settings/run_spec.h"
#include "results/system/file_descriptor.h"

namespace dreamsearch {

struct FilmRequest {
  std::uint64_t episode = 0;  // its index within the evaluation
  std::uint32_t width = 480;
  std::uint32_t height = 360;
  std::uint32_t camera = 0;
  std::uint32_t most_frames_per_second = 30;  // of simulated time; fewer where decisions are rarer

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("episode", &episode);
    (*archive)("width", &width);
    (*archive)("height", &height);
    (*archive)("camera", &camera);
    (*archive)("most_frames_per_second", &most_frames_per_second);
  }
};

class FilmedEpisode {
 public:
  // spec: an evaluation. agent: the trained run's checkpoint; empty for none. `who` names it in
  // messages.
  FilmedEpisode(const RunSpec& spec, const std::filesystem::path& agent, const FilmRequest& request,
                const std::string& who);
  ~FilmedEpisode();
  FilmedEpisode(const FilmedEpisode&) = delete;
  FilmedEpisode& operator=(const FilmedEpisode&) = delete;

  // The next frame; nothing after the last, which shows the episode's end. Throws Failure with
  // the child's message and exit code, 69 where the environment draws no pictures, 71 if the
  // child crashed.
  std::optional<Frame> Next();

  // Of what Next returns; known after its first call.
  double frames_per_second() const { return frames_per_second_; }

 private:
  std::string ReadLine();
  void ReadExactly(char* to, std::size_t size);
  bool Fill();
  [[noreturn]] void Fail();

  const std::string who_;
  const FilmRequest request_;
  pid_t pid_ = -1;
  FileDescriptor frames_;
  std::string buffer_;
  std::size_t read_ = 0;  // bytes of buffer_ that were handed out
  double frames_per_second_ = 0;
};

// The child's side: plays the episode that standard input describes.
int FilmEpisodeMain();

// Draws what `environment` shows. Failure 69 with the environment's reason if it cannot.
Picture SceneOf(Environment* environment, const std::string& name, std::uint32_t width,
                std::uint32_t height, std::uint32_t camera);

}  // namespace dreamsearch
