// A library that says when it was loaded: code that no command may run.
#include <cstdio>

__attribute__((constructor)) static void SayThatItWasLoaded() {
  if (std::FILE* file = std::fopen("loaded", "w")) std::fclose(file);
}
