#include "plugins/mujoco/renderer.h"

#include <EGL/egl.h>
#include <dlfcn.h>

#include <algorithm>
#include <string>

#include "plugins/mujoco/engine.h"

namespace dreamsearch::mujoco {
namespace {

// Of EGL_MESA_platform_surfaceless, which Debian's headers leave out.
constexpr EGLenum kSurfacelessPlatform = 0x31dd;
using GetPlatformDisplay = EGLDisplay (*)(EGLenum, void*, const EGLint*);

constexpr char kPackages[] = "install the packages libegl1 and libgl1-mesa-dri";

// The functions of libEGL, once a process.
struct Egl {
  decltype(&eglGetProcAddress) get_proc_address;
  decltype(&eglInitialize) initialize;
  decltype(&eglChooseConfig) choose_config;
  decltype(&eglBindAPI) bind_api;
  decltype(&eglCreateContext) create_context;
  decltype(&eglDestroyContext) destroy_context;
  decltype(&eglMakeCurrent) make_current;
  EGLDisplay display = nullptr;

  Egl() {
    void* library = ::dlopen("libEGL.so.1", RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) {
      throw EngineError(std::string("drawing needs OpenGL without a display: ") + kPackages + " (" +
                        ::dlerror() + ")");
    }
    const auto load = [&](auto* function, const char* name) {
      *function =
          reinterpret_cast<std::remove_pointer_t<decltype(function)>>(::dlsym(library, name));
      if (*function == nullptr) throw EngineError(std::string("libEGL.so.1 lacks ") + name);
    };
    load(&get_proc_address, "eglGetProcAddress");
    load(&initialize, "eglInitialize");
    load(&choose_config, "eglChooseConfig");
    load(&bind_api, "eglBindAPI");
    load(&create_context, "eglCreateContext");
    load(&destroy_context, "eglDestroyContext");
    load(&make_current, "eglMakeCurrent");
    const auto get_display =
        reinterpret_cast<GetPlatformDisplay>(get_proc_address("eglGetPlatformDisplayEXT"));
    if (get_display != nullptr) {
      display = get_display(kSurfacelessPlatform, EGL_DEFAULT_DISPLAY, nullptr);
    }
    if (display == nullptr || initialize(display, nullptr, nullptr) != EGL_TRUE ||
        bind_api(EGL_OPENGL_API) != EGL_TRUE) {
      throw EngineError(std::string("EGL cannot draw without a display here: ") + kPackages);
    }
  }
};

const Egl& TheEgl() {
  static const Egl egl;
  return egl;
}

}  // namespace

class Renderer::Context {
 public:
  Context() : egl_(TheEgl()) {
    const EGLint wanted[] = {EGL_SURFACE_TYPE,
                             EGL_PBUFFER_BIT,  // windows by default
                             EGL_RENDERABLE_TYPE,
                             EGL_OPENGL_BIT,
                             EGL_RED_SIZE,
                             8,
                             EGL_GREEN_SIZE,
                             8,
                             EGL_BLUE_SIZE,
                             8,
                             EGL_DEPTH_SIZE,
                             24,
                             EGL_STENCIL_SIZE,
                             8,
                             EGL_NONE};
    EGLConfig config = nullptr;
    EGLint found = 0;
    if (egl_.choose_config(egl_.display, wanted, &config, 1, &found) != EGL_TRUE || found == 0) {
      throw EngineError(std::string("EGL has no OpenGL: ") + kPackages);
    }
    context_ = egl_.create_context(egl_.display, config, EGL_NO_CONTEXT, nullptr);
    if (context_ == EGL_NO_CONTEXT) {
      throw EngineError(std::string("EGL makes no OpenGL context: ") + kPackages);
    }
  }
  ~Context() {
    egl_.make_current(egl_.display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    egl_.destroy_context(egl_.display, context_);
  }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  // From here on this thread draws with it.
  void MakeCurrent() {
    if (egl_.make_current(egl_.display, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) != EGL_TRUE) {
      throw EngineError("EGL does not give its context to this thread");
    }
  }

 private:
  const Egl& egl_;
  EGLContext context_ = EGL_NO_CONTEXT;
};

Renderer::Renderer(mjModel* model) : model_(model), context_(std::make_unique<Context>()) {
  mjv_defaultScene(&scene_);
  mjv_defaultOption(&options_);
  mjr_defaultContext(&resources_);
}

Renderer::~Renderer() {
  try {
    context_->MakeCurrent();
  } catch (const EngineError&) {
    return;
  }
  mjr_freeContext(&resources_);
  mjv_freeScene(&scene_);
}

void Renderer::MakeScene(int width, int height) {
  if (made_ && width <= width_ && height <= height_) return;
  width_ = std::max(width, width_);
  height_ = std::max(height, height_);
  if (made_) {
    mjr_freeContext(&resources_);
    mjv_freeScene(&scene_);
  }
  // The size of the picture that the context keeps in memory; physics knows nothing of it.
  model_->vis.global.offwidth = width_;
  model_->vis.global.offheight = height_;
  constexpr int kMostGeoms = 10000;
  mjv_makeScene(model_, &scene_, kMostGeoms);
  mjr_makeContext(model_, &resources_, mjFONTSCALE_100);
  mjr_setBuffer(mjFB_OFFSCREEN, &resources_);
  made_ = true;
  if (resources_.currentBuffer != mjFB_OFFSCREEN) {
    throw EngineError("OpenGL draws into no picture in memory here");
  }
}

void Renderer::Draw(mjData* data, int camera, int width, int height, std::uint8_t* rgb) {
  if (camera < 0 || (camera > 0 && camera >= model_->ncam)) {
    std::string known;
    for (int i = 0; i < model_->ncam; ++i) {
      const char* name = mj_id2name(model_, mjOBJ_CAMERA, i);
      known += (i > 0 ? ", " : "") + std::to_string(i) + (name ? std::string(" ") + name : "");
    }
    throw EngineError("camera " + std::to_string(camera) + ": the model has " +
                      (known.empty() ? "none but 0" : known));
  }
  context_->MakeCurrent();
  MakeScene(width, height);
  mjvCamera view;
  mjv_defaultCamera(&view);
  if (model_->ncam > 0) {
    view.type = mjCAMERA_FIXED;
    view.fixedcamid = camera;
  } else {
    mjv_defaultFreeCamera(model_, &view);
  }
  mjv_updateScene(model_, data, &options_, nullptr, &view, mjCAT_ALL, &scene_);
  const mjrRect whole = {0, 0, width, height};
  mjr_render(whole, &scene_, &resources_);
  mjr_readPixels(rgb, nullptr, whole, &resources_);
  // OpenGL's first row is the lowest.
  const auto row = static_cast<std::size_t>(width) * 3;
  for (int low = 0, high = height - 1; low < high; ++low, --high) {
    std::swap_ranges(rgb + static_cast<std::size_t>(low) * row,
                     rgb + static_cast<std::size_t>(low + 1) * row,
                     rgb + static_cast<std::size_t>(high) * row);
  }
}

}  // namespace dreamsearch::mujoco
