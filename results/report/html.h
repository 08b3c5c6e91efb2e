// html.h - the parts that the report's page is made of.
#pragma once

#include <string>

#include "results/figures/figure.h"
#include "results/text/table.h"

namespace dreamsearch::results {

std::string Note(const std::string& text);
std::string HtmlTable(const Table& table, const std::string& caption);
// Folded away until a reader opens it.
std::string Folded(const std::string& summary, const std::string& html);
// A text as it stands, line by line.
std::string Preformatted(const std::string& text);
std::string Query(const std::string& sql);
// A picture for everyone; `about` says in words what it shows.
std::string Picture(const Figure& figure, const std::string& about);
// A picture from the bytes of a PNG file, with what is to be read under it.
std::string PngPicture(const std::string& png, const std::string& about);
// For where there is no scripting.
std::string PictureWithoutScript(const Figure& figure, const std::string& about);

}  // namespace dreamsearch::results
