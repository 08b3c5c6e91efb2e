#include "results/figures/page/embedded.h"

// The assembler reads the files; their paths come from CMake.
#define EMBED(name, path)                                                                   \
  asm(".section .rodata\n"                                                                  \
      ".global dreamsearch_" #name                                                          \
      "_begin\n"                                                                            \
      ".global dreamsearch_" #name                                                          \
      "_end\n"                                                                              \
      "dreamsearch_" #name "_begin:\n.incbin \"" path                                       \
      "\"\n"                                                                                \
      "dreamsearch_" #name "_end:\n.byte 0\n.previous\n");                                  \
  extern "C" __attribute__((visibility("hidden"))) const char dreamsearch_##name##_begin[]; \
  extern "C" __attribute__((visibility("hidden"))) const char dreamsearch_##name##_end[];

EMBED(page_css, DREAMSEARCH_PAGE_CSS)
EMBED(page_js, DREAMSEARCH_PAGE_JS)
#ifdef DREAMSEARCH_CHART_JS
EMBED(chart_js, DREAMSEARCH_CHART_JS)
#endif

namespace dreamsearch::results {
namespace {

std::string_view Between(const char* begin, const char* end) {
  return {begin, static_cast<std::size_t>(end - begin)};
}

}  // namespace

std::string_view PageStyle() {
  return Between(dreamsearch_page_css_begin, dreamsearch_page_css_end);
}
std::string_view PageScript() {
  return Between(dreamsearch_page_js_begin, dreamsearch_page_js_end);
}
std::string_view ChartLibrary() {
#ifdef DREAMSEARCH_CHART_JS
  return Between(dreamsearch_chart_js_begin, dreamsearch_chart_js_end);
#else
  return {};
#endif
}

}  // namespace dreamsearch::results
