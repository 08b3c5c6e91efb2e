#include "results/figures/figure.h"

#include <algorithm>
#include <array>
#include <filesystem>

#include "results/figures/gnuplot.h"
#include "results/figures/gnuplot_script.h"
#include "results/figures/layout.h"
#include "results/system/error.h"
#include "results/system/file.h"

namespace dreamsearch::results {
namespace {

std::string Picture(const Figure& figure, PictureFormat format) {
  const std::string script = GnuplotScript(figure, Layout(figure), format);
  // Whoever shows an SVG picture has fonts of its own.
  const bool with_fonts = format != PictureFormat::kSvg;
  const std::string bytes = RunGnuplot(script, with_fonts);
  return format == PictureFormat::kSvg ? WithoutEmptyGroups(bytes) : bytes;
}

std::optional<PictureFormat> FormatOf(const std::string& path) {
  const std::string suffix = std::filesystem::path(path).extension().string();
  if (suffix == ".svg") return PictureFormat::kSvg;
  if (suffix == ".png") return PictureFormat::kPng;
  if (suffix == ".pdf") return PictureFormat::kPdf;
  return std::nullopt;
}

}  // namespace

Style StyleOf(int style) {
  // Okabe and Ito 2008, without its yellow, which vanishes on white, plus grey.
  static constexpr std::array<Style, 8> kStyles = {{
      {"#0072B2", "", Marker::kCircle},
      {"#D55E00", "14,4", Marker::kSquare},
      {"#009E73", "5,3", Marker::kTriangle},
      {"#CC79A7", "14,4,3,4", Marker::kDiamond},
      {"#000000", "2,3", Marker::kOpenSquare},
      {"#E69F00", "20,6", Marker::kDownTriangle},
      {"#56B4E9", "10,3,3,3,3,3", Marker::kOpenCircle},
      {"#777777", "3,6", Marker::kOpenTriangle},
  }};
  const auto place = static_cast<std::size_t>(style);
  const std::size_t round = place / kStyles.size();
  // 3 has no factor in common with 8: eight rounds are all different.
  const Style& shape = kStyles[(place + 3 * round) % kStyles.size()];
  return {kStyles[place % kStyles.size()].colour, shape.dash, shape.marker};
}

const char* MarkerName(Marker marker) {
  constexpr std::array kNames = {"circle",      "square",        "triangle",    "diamond",
                                 "open square", "down triangle", "open circle", "open triangle"};
  return kNames[static_cast<std::size_t>(marker)];
}

bool Panel::HasBars() const {
  return std::any_of(series.begin(), series.end(),
                     [](const Series& s) { return s.mark == Series::Mark::kBar; });
}

bool IsPicturePath(const std::string& path) { return FormatOf(path).has_value(); }

void Draw(const Figure& figure, const std::string& path) {
  const std::optional<PictureFormat> format = FormatOf(path);
  if (!format) {
    throw Failure(ExitCode::kUsage,
                  AbsolutePath(path) + ": expected a picture's suffix: .svg, .png or .pdf");
  }
  WriteFile(path, Picture(figure, *format));
}

std::string DrawSvg(const Figure& figure) { return Picture(figure, PictureFormat::kSvg); }

}  // namespace dreamsearch::results
