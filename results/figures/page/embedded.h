// embedded.h - the parts of the report's page that are not made from results,
// embedded in the program at build time.
#pragma once

#include <string_view>

namespace dreamsearch::results {

std::string_view PageStyle();     // page.css
std::string_view PageScript();    // page.js
std::string_view ChartLibrary();  // Chart.js; empty if the build did not find it

}  // namespace dreamsearch::results
