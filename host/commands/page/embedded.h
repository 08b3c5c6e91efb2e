// embedded.h - the page of `runner explain`, embedded in the program at build time.
#pragma once

#include <string_view>

namespace dreamsearch {

std::string_view ExplainTemplate();  // explain.html
std::string_view ExplainStyle();     // explain.css
std::string_view ExplainScript();    // explain.js

}  // namespace dreamsearch
