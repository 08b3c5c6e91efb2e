// picture.h - pixels, and what is written over a scene.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace dreamsearch {

struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;  // [height, width, 3], top row first
};

// A moment of an episode: the scene, and how it came about.
struct Frame {
  Picture scene;
  std::uint64_t decision = 0;  // decisions behind it
  double seconds = 0;          // simulated, since the episode began
  double episode_return = 0;   // so far
  // Of the decision that led here; none at the episode's start.
  std::vector<double> action;  // in [-1, 1]
  double value = 0;
  std::uint32_t simulations = 0;  // 0: it did not search
  std::uint32_t depth = 0;

  // All but the scene.
  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("decision", &decision);
    (*archive)("seconds", &seconds);
    (*archive)("return", &episode_return);
    (*archive)("action", &action);
    (*archive)("value", &value);
    (*archive)("simulations", &simulations);
    (*archive)("depth", &depth);
  }
};

// The scene with a line above that has the title and the return so far, and one below with the
// time, the search's depth and a bar for each action component, up for positive ones.
Picture Panel(const Frame& frame, const std::string& title);
// What Panel adds to a scene's height.
inline constexpr int kPanelLines = 60;

// Pictures of one size, left to right, then down; as many columns as given. Even in width and
// height, as video formats want it.
Picture Grid(const std::vector<Picture>& pictures, int columns);

Picture Scaled(const Picture& picture, int width, int height);

// The bytes of a PNG file.
std::string PngOf(const Picture& picture);

}  // namespace dreamsearch
