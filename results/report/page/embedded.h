// embedded.h - the parts of the report's page that are not made from results,
// embedded in the program at build time.
#pragma once

#include <string_view>

namespace dreamsearch {

std::string_view ReportTemplate();  // page.html
std::string_view ReportStyle();     // page.css
std::string_view ReportScript();    // page.js
std::string_view ChartLibrary();    // Chart.js; empty if the build did not find it

}  // namespace dreamsearch
