// The library missing_dependency.so needs.
int FromAnotherLibrary();
int FromAnotherLibrary() { return 1; }
