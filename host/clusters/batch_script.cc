#include "host/clusters/batch_script.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "host/plugins/describing.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

constexpr std::uint64_t kMebibyte = 1 << 20;
constexpr double kMergeSeconds = 3600;

// The value of an #SBATCH line. Slurm expands % in file names only.
std::string Quoted(const std::string& text, bool file_name) {
  for (const char c : text) {
    if (static_cast<unsigned char>(c) >= 0x20 && c != '"' && c != '\\' && c != '\'') continue;
    throw Failure(ExitCode::kUsage,
                  "runner submit: expected a folder that a line of #SBATCH can "
                  "name, found a quotation mark, a backslash or a control "
                  "character in " +
                      ShellWord(text));
  }
  std::string quoted = "\"";
  for (const char c : text) quoted += file_name && c == '%' ? "%%" : std::string(1, c);
  return quoted + "\"";
}

// "1-04:00:00".
std::string TimeText(double seconds) {
  const auto whole = static_cast<long long>(std::ceil(seconds));
  char text[64];
  std::snprintf(text, sizeof text, "%lld-%02lld:%02lld:%02lld", whole / 86400, whole / 3600 % 24,
                whole / 60 % 60, whole % 60);
  return text;
}

std::string Option(const std::string& text) { return "#SBATCH --" + text + "\n"; }

std::string Head(const BatchPlace& place, const Allocation& allocation, const std::string& name,
                 const std::string& log) {
  std::string text = "#!/bin/bash\n";
  text += Option("job-name=" + name);
  text += Option("chdir=" + Quoted(place.working.string(), false));
  const std::string logs = Quoted((place.folder / "logs" / "").string(), true);
  text += Option("output=" + logs.substr(0, logs.size() - 1) + log + "\"");
  text += Option("open-mode=append");
  text += Option("requeue");
  text += Option("nodes=1");
  text += Option("ntasks=1");
  text += Option("cpus-per-task=" + std::to_string(allocation.cores));
  if (!allocation.partition.empty()) text += Option("partition=" + allocation.partition);
  if (!allocation.account.empty()) text += Option("account=" + allocation.account);
  if (allocation.time_seconds > 0) text += Option("time=" + TimeText(allocation.time_seconds));
  if (allocation.memory_bytes > 0) {
    text += Option("mem=" + std::to_string((allocation.memory_bytes + kMebibyte - 1) / kMebibyte) +
                   "M");
  }
  return text;
}

std::string Extra(const Allocation& allocation) {
  std::string text;
  for (const std::string& line : allocation.extra_lines) text += line + "\n";
  return text;
}

std::string Variables(const BatchPlace& place) {
  return "export DREAMSEARCH_INSTRUCTION_SET=" + ShellWord(place.instruction_set) + "\n" +
         "folder=" + ShellWord(place.folder.string()) + "\n" +
         "runner=" + ShellWord(place.runner.string()) + "\n";
}

// `run` and `child` are of the loop; a signal before it begins stops it as well.
constexpr char kArrayBody[] = R"(
# Slurm tells this script alone that its end is near. runner hears of it once: it takes a second
# signal of a terminal for impatience.
child=
asked=
forward() {
  if [[ -n $asked ]]; then return; fi
  asked=$1
  echo "$(date -u +%FT%TZ) signal $1"
  # A shell's background process ignores SIGINT.
  if [[ -n $child ]]; then kill -s TERM "$child" 2>/dev/null; fi
}
for signal in INT TERM HUP USR1 USR2 XCPU; do
  trap "forward $signal" "$signal"
done

# Sets `code` to what the child ends with; a signal ends the waiting, not the child.
wait_for_child() {
  wait "$child"
  code=$?
  while ((code > 128)) && kill -0 "$child" 2>/dev/null; do
    wait "$child"
    code=$?
  done
  if ((code > 128)); then
    wait "$child" 2>/dev/null
    local again=$?
    if ((again != 127)); then code=$again; fi
  fi
  child=
}

status=0
stopped=
for run in ${tasks[SLURM_ARRAY_TASK_ID]}; do
  if [[ -n $asked ]]; then
    stopped=yes
    break
  fi
  echo "$(date -u +%FT%TZ) $SLURMD_NODENAME, restart ${SLURM_RESTART_COUNT:-0}: run $run"
  "$runner" --config "$folder/runs/$run.cfg" --db "$folder/runs/$run.db" "${flags[@]}" &
  child=$!
  if [[ -n $asked ]]; then kill -s TERM "$child" 2>/dev/null; fi
  wait_for_child
  if ((code == 75)); then
    stopped=yes
  elif ((code != 0 && status == 0)); then
    status=$code
  fi
done
if [[ -z $stopped ]]; then exit "$status"; fi

# Slurm requeues no job for its exit status. A job that Slurm is ending already (cancelled,
# pre-empted, requeued by somebody) is left to it.
task=${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID
if [[ $(squeue --noheader --jobs="$task" --format=%T 2>/dev/null) == RUNNING ]]; then
  echo "$(date -u +%FT%TZ) stopped with a checkpoint; back into the queue"
  scontrol requeue "$task"
fi
exit 75
)";

constexpr char kMergeBody[] = R"(
cd "$folder" || exit 74
shopt -s nullglob
databases=(runs/*.db)
status=0
if ((${#databases[@]} == 0)); then
  echo "no run has recorded anything; the logs in $folder/logs say why" >&2
  exit 66
fi
if ! "$results" merge "${databases[@]}" --db all.db; then
  # One that cannot be read must not cost the others.
  for database in "${databases[@]}"; do
    "$results" merge "$database" --db all.db || status=$?
  done
fi
"$results" report report.html --db all.db || status=$?
echo "runs that are not finished:"
"$runner" status --folder . --unfinished || status=$?
exit "$status"
)";

}  // namespace

std::vector<std::string> ExtraLines(const std::filesystem::path& file) {
  const std::string path = AbsolutePath(file.string());
  std::istringstream stream(ReadWholeFile(path));
  std::vector<std::string> lines;
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    if (line.ends_with('\r')) line.pop_back();
    if (line.find_first_not_of(" \t") == std::string::npos) continue;
    const std::string where = path + ", line " + std::to_string(number) + ": ";
    if (!line.starts_with("#SBATCH ") || !IsUtf8(line)) {
      throw Failure(ExitCode::kBadInput, where +
                                             "expected #SBATCH and an option of sbatch, found '" +
                                             Printable(line.substr(0, 60)) + "'");
    }
    for (const char* own : {"--array", "-a ", "--dependency", "-d ", "--chdir", "-D "}) {
      if (line.find(std::string(" ") + own) == std::string::npos) continue;
      throw Failure(ExitCode::kBadInput, where + "expected another option, found " + own +
                                             ", which `runner submit` gives itself");
    }
    lines.push_back(line);
  }
  return lines;
}

std::string ArrayScript(const BatchPlace& place, const Allocation& allocation,
                        const std::vector<std::vector<std::string>>& tasks,
                        const std::vector<std::string>& flags, bool retry) {
  std::string text = Head(place, allocation, "dreamsearch", "%A_%a.log");
  text += Option("signal=B:USR1@" + std::to_string(kNoticeSeconds));
  text += Option("array=0-" + std::to_string(tasks.size() - 1));
  text += Extra(allocation) + "\n" + Variables(place);
  // So that no task starts every plugin to learn what is in it.
  text +=
      std::string("export ") + kKnownPluginsVariable + "=\"$folder\"/" + kKnownPluginsFile + "\n";
  text += "flags=(" + ShellCommand(flags) + ")\n";
  if (retry) {
    // Not what failed in this very task before it was requeued.
    text += "if ((${SLURM_RESTART_COUNT:-0} == 0)); then flags+=(--retry); fi\n";
  }
  text += "tasks=(\n";
  for (const std::vector<std::string>& runs : tasks) {
    std::string list;
    for (const std::string& run : runs) list += (list.empty() ? "" : " ") + run;
    text += "  \"" + list + "\"\n";
  }
  return text + ")\n" + kArrayBody;
}

std::string MergeScript(const BatchPlace& place, const Allocation& allocation,
                        const std::vector<std::string>& after) {
  Allocation own = allocation;
  own.cores = 1;
  if (own.time_seconds > 0) own.time_seconds = std::min(own.time_seconds, kMergeSeconds);
  std::string text = Head(place, own, "dreamsearch-merge", "merge_%j.log");
  if (!after.empty()) {
    std::string list;
    for (const std::string& job : after) list += ":" + job;
    text += Option("dependency=afterany" + list);
  }
  text += Extra(own) + "\n" + Variables(place);
  text += "results=" + ShellWord(place.results.string()) + "\n";
  return text + kMergeBody;
}

}  // namespace dreamsearch
