// renderer.h - pictures of a model without a display.
//
// MuJoCo's own renderer in an OpenGL context that belongs to no window (EGL, surfaceless). The
// library of EGL is loaded when the first picture is asked for, so that nothing else needs it.
#pragma once

#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>

namespace dreamsearch::mujoco {

class Renderer {
 public:
  //   EngineError  there is no EGL, or it has no context for us; the text says which packages
  //                to install.
  explicit Renderer(mjModel* model);
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  // Draws what data holds, which it leaves as it is, as the model's camera sees it; a model
  // without cameras is seen by a free one. rgb: [height, width, 3], top row first.
  void Draw(mjData* data, int camera, int width, int height, std::uint8_t* rgb);

 private:
  class Context;

  void MakeScene(int width, int height);

  mjModel* const model_;
  std::unique_ptr<Context> context_;
  mjvScene scene_;
  mjvOption options_;
  mjrContext resources_;
  bool made_ = false;
  int width_ = 0, height_ = 0;  // the largest picture so far
};

}  // namespace dreamsearch::mujoco
