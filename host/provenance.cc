#include "provenance.h"

#include <sys/syscall.h>
#include <sys/sysinfo.h>
#include <sys/utsname.h>
#include <unistd.h>
#if defined(__x86_64__)
#include <cpuid.h>
#endif

#include <boost/version.hpp>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "dreamsearch/version.h"
#include "dreamsearch_build_info.h"

namespace dreamsearch {

namespace {

// Whether the system lets this process use the tile unit's bfloat16 products, which
// plugins choose while they run, whatever they were compiled for.
bool HasTiles() {
#if defined(__x86_64__)
  unsigned a = 0, b = 0, c = 0, d = 0;
  if (__get_cpuid_count(7, 0, &a, &b, &c, &d) == 0) return false;
  if ((d >> 22 & 1) == 0 || (d >> 24 & 1) == 0) return false;  // amx-bf16, amx-tile
  constexpr long kRequestPermission = 0x1023;                  // ARCH_REQ_XCOMP_PERM
  constexpr long kTileData = 18;
  return ::syscall(SYS_arch_prctl, kRequestPermission, kTileData) == 0;
#else
  return false;
#endif
}

}  // namespace

std::string InstructionSet() {
  static const bool tiles = HasTiles();
  std::string set = "x86-64";
#if DREAMSEARCH_BUILD_NATIVE
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) set = "avx2";
  if (__builtin_cpu_supports("avx512f")) set = "avx512";
  if (__builtin_cpu_supports("avx512bf16")) set += "+bf16";
#endif
  return tiles ? set + "+amx" : set;
}

results::BuildInfo ThisBuild() {
  results::BuildInfo build;
  build.version = DREAMSEARCH_VERSION;
  build.commit = DREAMSEARCH_BUILD_COMMIT;
  build.dirty = DREAMSEARCH_BUILD_DIRTY;
  build.compiler = "g++ " __VERSION__;
  build.flags = DREAMSEARCH_BUILD_FLAGS;
  build.instruction_set = InstructionSet();
  build.libraries = nlohmann::json{{"boost", BOOST_LIB_VERSION}}.dump();
  return build;
}

results::HostInfo ThisHost() {
  results::HostInfo host;
  char name[256] = "";
  ::gethostname(name, sizeof name - 1);
  host.hostname = name;
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);) {
    if (line.rfind("model name", 0) == 0) {
      host.cpu = line.substr(line.find(':') + 2);
      break;
    }
  }
  host.cores = std::thread::hardware_concurrency();
  struct sysinfo info {};
  if (::sysinfo(&info) == 0) {
    host.memory_bytes = static_cast<std::int64_t>(info.totalram) * info.mem_unit;
  }
  struct utsname system {};
  if (::uname(&system) == 0) {
    host.os = std::string(system.sysname) + " " + system.release + " " + system.machine;
  }
  return host;
}

}  // namespace dreamsearch
