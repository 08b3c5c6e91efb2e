#include "host/training/build_and_host.h"

#include <sys/sysinfo.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <boost/version.hpp>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "dreamsearch/instruction_set.h"
#include "dreamsearch/version.h"
#include "dreamsearch_build_info.h"
#include "results/system/error.h"
#include "results/text/json_text.h"
#include "results/text/names.h"

namespace dreamsearch {

std::string InstructionSetInUse() { return InstructionSetName(ChosenInstructionSet()); }

void CheckInstructionSet() {
  const char* name = std::getenv(kInstructionSetVariable);
  if (name == nullptr) return;
  std::vector<std::string> here;
  for (const InstructionSet set : kInstructionSets) {
    if (set <= BestInstructionSet()) here.push_back(InstructionSetName(set));
  }
  InstructionSet asked{};
  if (!ParseInstructionSet(name, &asked) || asked > BestInstructionSet()) {
    throw Failure(ExitCode::kUsage, std::string(kInstructionSetVariable) + "=" + name +
                                        ": expected an instruction set of this processor: " +
                                        JoinNames(here) + "; or unset it for the last");
  }
}

results::BuildInfo ThisBuild() {
  results::BuildInfo build;
  build.version = DREAMSEARCH_VERSION;
  build.commit = DREAMSEARCH_BUILD_COMMIT;
  build.dirty = DREAMSEARCH_BUILD_DIRTY;
  build.compiler = "g++ " __VERSION__;
  build.flags = DREAMSEARCH_BUILD_FLAGS;
  build.instruction_set = InstructionSetInUse();
  build.libraries = results::JsonText(nlohmann::json{{"boost", BOOST_LIB_VERSION}});
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

void AddSlurmJob(results::SegmentInfo* segment) {
  const auto text = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value == nullptr ? "" : value);
  };
  segment->slurm_job = text("SLURM_JOB_ID");
  if (segment->slurm_job.empty()) return;
  // Every task of an array has a job number of its own as well, by which nobody knows it.
  if (const std::string array = text("SLURM_ARRAY_JOB_ID"); !array.empty()) {
    segment->slurm_job = array + "_" + text("SLURM_ARRAY_TASK_ID");
  }
  segment->slurm_node = text("SLURMD_NODENAME");
  // Set once a job was requeued.
  segment->slurm_restarts = std::strtoll(text("SLURM_RESTART_COUNT").c_str(), nullptr, 10);
}

}  // namespace dreamsearch
