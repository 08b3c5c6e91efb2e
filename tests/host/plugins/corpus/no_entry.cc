// A library that exports something else.
extern "C" __attribute__((visibility("default"))) int not_a_plugin();
extern "C" int not_a_plugin() { return 1; }
