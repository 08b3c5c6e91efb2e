// Its entry returns nothing.
#include "dreamsearch/plugin.h"

extern "C" __attribute__((visibility("default"))) const dreamsearch::PluginDescriptor*
dreamsearch_plugin_v0() {
  return nullptr;
}
