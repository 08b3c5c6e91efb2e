// misbound.cc - must not compile: the member does not hold the parameter's range.
#include "dreamsearch/settings.h"

namespace {

struct Settings {
  std::uint8_t depth;
};
constexpr auto kSettings = dreamsearch::BindSettings<Settings>(
    dreamsearch::Bind<&Settings::depth>(dreamsearch::IntParameter("depth", 10, 1, 1000, "", "")));

}  // namespace

int main() { return static_cast<int>(kSettings.declared().size); }
