// Its entry returns nothing.
#include "dreamsearch/plugin.h"

extern "C" __attribute__((visibility("default"))) const dreamsearch::PluginDescriptor*
dreamsearch_sdk_1() {
  return nullptr;
}
