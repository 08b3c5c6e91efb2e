// gnuplot_script.h - a laid out figure as commands of gnuplot.
#pragma once

#include <string>

#include "results/figures/figure.h"
#include "results/figures/layout.h"

namespace dreamsearch::results {

enum class PictureFormat { kSvg, kPng, kPdf };

// The picture goes to the file `figure` in the folder in which gnuplot runs.
std::string GnuplotScript(const Figure& figure, const Layout& layout, PictureFormat format);

}  // namespace dreamsearch::results
