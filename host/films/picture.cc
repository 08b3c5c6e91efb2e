#include "host/films/picture.h"

#include <cairo.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "results/system/error.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

struct SurfaceDeleter {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
using Surface = std::unique_ptr<cairo_surface_t, SurfaceDeleter>;
struct PenDeleter {
  void operator()(cairo_t* pen) const { cairo_destroy(pen); }
};
using Pen = std::unique_ptr<cairo_t, PenDeleter>;

Surface Checked(cairo_surface_t* surface) {
  Surface made(surface);
  if (cairo_surface_status(surface) != CAIRO_STATUS_SUCCESS) {
    throw Failure(ExitCode::kInternal, std::string("cannot draw: ") +
                                           cairo_status_to_string(cairo_surface_status(surface)));
  }
  return made;
}

Surface SurfaceOf(const Picture& picture) {
  Surface surface =
      Checked(cairo_image_surface_create(CAIRO_FORMAT_RGB24, picture.width, picture.height));
  unsigned char* to = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  const std::uint8_t* from = picture.rgb.data();
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x, from += 3) {
      const std::uint32_t pixel =
          std::uint32_t{from[0]} << 16 | std::uint32_t{from[1]} << 8 | std::uint32_t{from[2]};
      std::memcpy(to + y * stride + 4 * x, &pixel, sizeof pixel);
    }
  }
  cairo_surface_mark_dirty(surface.get());
  return surface;
}

Picture PictureOf(const Surface& surface) {
  cairo_surface_flush(surface.get());
  Picture picture;
  picture.width = cairo_image_surface_get_width(surface.get());
  picture.height = cairo_image_surface_get_height(surface.get());
  picture.rgb.resize(static_cast<std::size_t>(picture.width) *
                     static_cast<std::size_t>(picture.height) * 3);
  const unsigned char* from = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  std::uint8_t* to = picture.rgb.data();
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x, to += 3) {
      std::uint32_t pixel;
      std::memcpy(&pixel, from + y * stride + 4 * x, sizeof pixel);
      to[0] = static_cast<std::uint8_t>(pixel >> 16);
      to[1] = static_cast<std::uint8_t>(pixel >> 8);
      to[2] = static_cast<std::uint8_t>(pixel);
    }
  }
  return picture;
}

constexpr double kTextSize = 13;
constexpr double kMargin = 8;
constexpr int kTopLine = 26;
constexpr int kBottomLine = kPanelLines - kTopLine;

double WidthOf(cairo_t* pen, const std::string& text) {
  cairo_text_extents_t extents;
  cairo_text_extents(pen, text.c_str(), &extents);
  return extents.x_advance;
}

void Write(cairo_t* pen, double x, double y, const std::string& text) {
  cairo_move_to(pen, x, y);
  cairo_show_text(pen, text.c_str());
}

// What says the most in that width: the first text that fits, or the last, cut.
std::string Fitting(cairo_t* pen, double width, const std::vector<std::string>& texts) {
  for (const std::string& text : texts) {
    if (WidthOf(pen, text) <= width) return text;
  }
  std::string cut = texts.back();
  while (cut.size() > 4 && WidthOf(pen, cut) > width) cut = cut.substr(0, cut.size() - 4) + "...";
  return cut;
}

// Bars round a middle line, as wide as there is room for; returns the left edge.
double DrawBars(cairo_t* pen, const std::vector<double>& action, double right, double top,
                double height, double room) {
  const auto count = static_cast<double>(action.size());
  const double step = std::min(12.0, room / std::max(count, 1.0));
  const double left = right - step * count;
  const double middle = top + height / 2;
  cairo_set_source_rgb(pen, 0.45, 0.48, 0.55);
  cairo_rectangle(pen, left, middle - 0.5, step * count, 1);
  cairo_fill(pen);
  for (std::size_t i = 0; i < action.size(); ++i) {
    const double value = std::clamp(action[i], -1.0, 1.0);
    cairo_set_source_rgb(pen, value >= 0 ? 0.38 : 0.95, value >= 0 ? 0.70 : 0.60,
                         value >= 0 ? 0.98 : 0.30);
    const double length = value * (height / 2 - 1);
    cairo_rectangle(pen, left + step * static_cast<double>(i) + 0.15 * step,
                    std::min(middle, middle - length), 0.7 * step, std::abs(length));
    cairo_fill(pen);
  }
  return left;
}

}  // namespace

Picture Panel(const Frame& frame, const std::string& title) {
  const Picture& scene = frame.scene;
  const Surface surface = Checked(
      cairo_image_surface_create(CAIRO_FORMAT_RGB24, scene.width, scene.height + kPanelLines));
  const Pen owned(cairo_create(surface.get()));
  cairo_t* pen = owned.get();
  cairo_set_source_rgb(pen, 0.10, 0.11, 0.14);
  cairo_paint(pen);
  const Surface picture = SurfaceOf(scene);
  cairo_set_source_surface(pen, picture.get(), 0, kTopLine);
  cairo_paint(pen);

  cairo_select_font_face(pen, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_BOLD);
  cairo_set_font_size(pen, kTextSize);
  cairo_set_source_rgb(pen, 0.96, 0.96, 0.96);
  const double right = scene.width - kMargin;
  const std::string earned = "return " + FormatNumber("%.1f", frame.episode_return);
  const double earned_left = right - WidthOf(pen, earned);
  Write(pen, earned_left, 18, earned);
  Write(pen, kMargin, 18, Fitting(pen, earned_left - 2 * kMargin, {title}));

  cairo_select_font_face(pen, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(pen, kTextSize - 2);
  const double below = kTopLine + scene.height;
  double room = right - kMargin;
  if (!frame.action.empty()) {
    room = DrawBars(pen, frame.action, right, below + 2, kBottomLine - 4, scene.width / 3.0) -
           2 * kMargin;
  }
  cairo_set_source_rgb(pen, 0.80, 0.82, 0.86);
  const std::string decision = "decision " + std::to_string(frame.decision);
  std::vector<std::string> when = {decision};
  if (frame.seconds > 0 || frame.decision == 0) {
    when.insert(when.begin(), FormatNumber("%.2f s", frame.seconds) + ", " + decision);
  }
  Write(pen, kMargin, below + 14, Fitting(pen, room, when));
  if (frame.simulations > 0) {
    const std::string depth = "depth " + std::to_string(frame.depth);
    const std::string value = ", value " + FormatNumber("%.1f", frame.value);
    const std::string simulations = ", " + std::to_string(frame.simulations) + " simulations";
    Write(pen, kMargin, below + 29,
          Fitting(pen, room, {"search: " + depth + simulations + value, depth + value, depth}));
  } else if (frame.decision > 0) {
    Write(pen, kMargin, below + 29, Fitting(pen, room, {"no search"}));
  }
  return PictureOf(surface);
}

Picture Grid(const std::vector<Picture>& pictures, int columns) {
  if (pictures.empty() || columns < 1) {
    throw Failure(ExitCode::kInternal, "a grid of pictures needs pictures and columns");
  }
  const int shown = std::min(columns, static_cast<int>(pictures.size()));
  const int rows = (static_cast<int>(pictures.size()) + shown - 1) / shown;
  const int width = pictures[0].width, height = pictures[0].height;
  Picture grid;
  grid.width = (width * shown + 1) / 2 * 2;
  grid.height = (height * rows + 1) / 2 * 2;
  grid.rgb.assign(static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height) * 3,
                  0);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const Picture& picture = pictures[i];
    if (picture.width != width || picture.height != height) {
      throw Failure(ExitCode::kInternal, "a grid of pictures needs pictures of one size");
    }
    const int left = static_cast<int>(i) % shown * width;
    const int top = static_cast<int>(i) / shown * height;
    for (int y = 0; y < height; ++y) {
      std::memcpy(
          grid.rgb.data() +
              (static_cast<std::size_t>(top + y) * static_cast<std::size_t>(grid.width) +
               static_cast<std::size_t>(left)) *
                  3,
          picture.rgb.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width) * 3,
          static_cast<std::size_t>(width) * 3);
    }
  }
  return grid;
}

Picture Scaled(const Picture& picture, int width, int height) {
  const Surface from = SurfaceOf(picture);
  const Surface surface = Checked(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height));
  const Pen pen(cairo_create(surface.get()));
  cairo_scale(pen.get(), static_cast<double>(width) / picture.width,
              static_cast<double>(height) / picture.height);
  cairo_set_source_surface(pen.get(), from.get(), 0, 0);
  cairo_pattern_set_filter(cairo_get_source(pen.get()), CAIRO_FILTER_BEST);
  cairo_paint(pen.get());
  return PictureOf(surface);
}

std::string PngOf(const Picture& picture) {
  std::string bytes;
  const auto append = [](void* to, const unsigned char* data, unsigned int size) {
    static_cast<std::string*>(to)->append(reinterpret_cast<const char*>(data), size);
    return CAIRO_STATUS_SUCCESS;
  };
  const cairo_status_t status =
      cairo_surface_write_to_png_stream(SurfaceOf(picture).get(), append, &bytes);
  if (status != CAIRO_STATUS_SUCCESS) {
    throw Failure(ExitCode::kInternal,
                  std::string("cannot make a PNG: ") + cairo_status_to_string(status));
  }
  return bytes;
}

}  // namespace dreamsearch
