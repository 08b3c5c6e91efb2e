// gnuplot.h - runs gnuplot.
#pragma once

#include <string>

namespace dreamsearch::results {

// Runs the script in a folder of its own, so that no name of the user's gets into
// it, and returns the bytes of the file `figure` that it made there. With `with_fonts` letters
// that no font has are replaced first. Failure 66 if gnuplot is not installed.
std::string RunGnuplot(const std::string& script, bool with_fonts);

// An SVG picture of gnuplot's at half its size: it leaves a group for every change of pen,
// most of them empty.
std::string WithoutEmptyGroups(const std::string& svg);

}  // namespace dreamsearch::results
