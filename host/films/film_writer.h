// film_writer.h - where the pictures of a film go.
#pragma once

#include <memory>
#include <string>

#include "host/films/picture.h"

namespace dreamsearch {

class FilmWriter {
 public:
  // Chosen by what `path` ends with: .mp4, .webm and .gif are made by the program ffmpeg, .png is
  // one sheet of pictures from beginning to end, and a folder (there already, or named with a
  // slash) gets a PNG file for each picture. Nothing is left at `path` unless Finish returns.
  //   Failure 2 for another ending, 66 without ffmpeg, 73 and 74 for files.
  static std::unique_ptr<FilmWriter> Make(const std::string& path, double frames_per_second);
  // Failure 2 if Make would not know what to do with it.
  static void CheckPath(const std::string& path);

  virtual ~FilmWriter() = default;
  // All pictures have the size of the first.
  virtual void Add(const Picture& picture) = 0;
  virtual void Finish() = 0;
};

// Pictures evenly spread over as many as were added, of which few are kept at any time; the first
// and the last are among them.
class PictureSheet {
 public:
  explicit PictureSheet(std::size_t wanted) : wanted_(wanted) {}
  void Add(const Picture& picture);
  // At most `wanted`, in their order.
  std::vector<Picture> Chosen() const;

 private:
  const std::size_t wanted_;
  std::size_t seen_ = 0;
  std::size_t stride_ = 1;  // every so manieth is kept
  std::vector<Picture> kept_;
  Picture last_;
};

}  // namespace dreamsearch
