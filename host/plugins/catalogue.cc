#include "host/plugins/catalogue.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>
#include <system_error>
#include <thread>
#include <tuple>

#include "host/plugins/plugin_loader.h"
#include "results/system/descriptor.h"
#include "results/system/json_text.h"
#include "results/system/names.h"
#include "results/system/sha256.h"

extern char** environ;

namespace dreamsearch {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::json;

// What a child writes last; without it the description may be cut short.
constexpr std::string_view kDoneToken = "\ndone\n";

std::string TextOrEmpty(const char* text) { return text == nullptr ? "" : text; }

std::vector<std::string> SplitList(std::string_view list, char separator) {
  std::vector<std::string> parts;
  while (!list.empty()) {
    const auto end = list.find(separator);
    if (end != 0) parts.emplace_back(list.substr(0, end));
    if (end == std::string_view::npos) break;
    list.remove_prefix(end + 1);
  }
  return parts;
}

ComponentInfo DescribeComponent(const ComponentDescriptor& component) {
  ComponentInfo info;
  info.kind = component.kind;
  info.name = component.name;
  info.aliases = SplitList(TextOrEmpty(component.aliases), ',');
  info.version = component.version;
  info.summary = component.summary;
  info.traits = component.traits;
  for (const ParameterSpec& spec : component.parameters) {
    info.parameters.push_back(DescribeParameter(spec));
  }
  for (const MetricSpec& metric : component.metrics) {
    info.metrics.push_back({metric.name, TextOrEmpty(metric.unit), TextOrEmpty(metric.help)});
  }
  return info;
}

// --- the parent's side -------------------------------------------------------

// A file descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int value = -1) : value_(value) {}
  Descriptor(Descriptor&& other) noexcept : value_(std::exchange(other.value_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(value_, other.value_);
    return *this;
  }
  ~Descriptor() { Close(); }

  int get() const { return value_; }
  void Close() {
    if (value_ >= 0) ::close(value_);
    value_ = -1;
  }

 private:
  int value_;
};

[[noreturn]] void ThrowSystem(const std::string& what, int error) {
  throw Failure(ExitCode::kInternal, what + ": " + std::strerror(error));
}

struct Pipe {
  Descriptor read;
  Descriptor write;
};

Pipe MakePipe() {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) ThrowSystem("cannot make a pipe", errno);
  Pipe low{Descriptor(ends[0]), Descriptor(ends[1])};
  // Above the numbers the child's own descriptors are put on.
  Pipe high{Descriptor(::fcntl(ends[0], F_DUPFD_CLOEXEC, kDescribeDescriptor + 1)),
            Descriptor(::fcntl(ends[1], F_DUPFD_CLOEXEC, kDescribeDescriptor + 1))};
  if (high.read.get() < 0 || high.write.get() < 0) ThrowSystem("cannot make a pipe", errno);
  ::fcntl(high.read.get(), F_SETFL, O_NONBLOCK);
  return high;
}

// Starts the describing program on one file. Whatever the library prints does
// not reach our output, and one that reads finds the end of its input.
pid_t Spawn(const std::string& file, const ScanOptions& options, int description, int errors) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, description, kDescribeDescriptor);

  // A group of its own, so that what the library starts ends with it; default
  // signals, whatever the host blocks or ignores.
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  sigset_t none, all;
  ::sigemptyset(&none);
  ::sigfillset(&all);
  ::posix_spawnattr_setpgroup(&attributes, 0);
  ::posix_spawnattr_setsigmask(&attributes, &none);
  ::posix_spawnattr_setsigdefault(&attributes, &all);
  ::posix_spawnattr_setflags(
      &attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);

  std::vector<std::string> words = {options.program};
  words.insert(words.end(), options.arguments.begin(), options.arguments.end());
  words.push_back(file);
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  pid_t child = 0;
  const int failure =
      ::posix_spawn(&child, options.program.c_str(), &actions, &attributes, argv.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::posix_spawnattr_destroy(&attributes);
  if (failure != 0) ThrowSystem("cannot start " + options.program, failure);
  return child;
}

// Appends what there is to *text and keeps its last `most` bytes. Returns false
// at the end of the stream.
bool ReadAvailable(const Descriptor& descriptor, std::size_t most, std::string* text) {
  char block[65536];
  for (;;) {
    const ssize_t got = ::read(descriptor.get(), block, sizeof block);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return errno == EAGAIN;
    if (got == 0) return false;
    text->append(block, static_cast<std::size_t>(got));
    if (text->size() > most) text->erase(0, text->size() - most);
    // One block a call: a library that never stops printing must not keep us
    // from looking at the clock.
    return true;
  }
}

struct ChildResult {
  std::string description;  // without the token
  bool done = false;        // the token came
  bool timed_out = false;
  int wait_status = 0;
  std::string errors;  // the end of what it wrote to standard error
};

// Runs the describing program on one file until it has written its token, has
// ended, or the time is over. The child is gone when this returns.
ChildResult RunChild(const std::string& file, const ScanOptions& options) {
  constexpr std::size_t kMostDescription = 64 << 20, kMostErrors = 4096;
  constexpr int kPollMilliseconds = 20;
  Pipe description = MakePipe();
  Pipe errors = MakePipe();
  const Clock::time_point deadline = Clock::now() + options.timeout;
  const pid_t child = Spawn(file, options, description.write.get(), errors.write.get());
  description.write.Close();
  errors.write.Close();

  ChildResult result;
  bool description_open = true, errors_open = true;
  for (;;) {
    // Ended, but not yet reaped: its process group cannot be another's by now.
    siginfo_t info = {};
    const bool ended =
        ::waitid(P_PID, static_cast<id_t>(child), &info, WEXITED | WNOWAIT | WNOHANG) == 0 &&
        info.si_pid == child;
    if (description_open) {
      description_open = ReadAvailable(description.read, kMostDescription, &result.description);
      result.done = result.description.ends_with(kDoneToken);
    }
    if (errors_open) errors_open = ReadAvailable(errors.read, kMostErrors, &result.errors);
    if (ended && result.done) break;
    if (ended) {
      // All it wrote is in the pipe; a grandchild may hold the other end open.
      pollfd ready = {description.read.get(), POLLIN, 0};
      if (!description_open || ::poll(&ready, 1, 0) == 0 || Clock::now() >= deadline) break;
      continue;
    }
    if (Clock::now() >= deadline) {
      result.timed_out = !result.done;
      break;
    }
    pollfd ready[2] = {{description_open ? description.read.get() : -1, POLLIN, 0},
                       {errors_open ? errors.read.get() : -1, POLLIN, 0}};
    ::poll(ready, 2, kPollMilliseconds);
  }
  ::kill(-child, SIGKILL);
  while (::waitpid(child, &result.wait_status, 0) < 0 && errno == EINTR) {
  }
  if (errors_open) ReadAvailable(errors.read, kMostErrors, &result.errors);
  if (result.done) result.description.resize(result.description.size() - kDoneToken.size());
  return result;
}

// The last line of a text, printable and short; empty if there is none.
std::string LastLine(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  std::string line = text.substr(text.find_last_of("\r\n") + 1);  // npos + 1 is 0
  line.erase(0, std::min(line.find_first_not_of(" \t"), line.size()));
  constexpr std::size_t kMost = 200;
  if (line.size() > kMost) line = line.substr(0, kMost) + "...";
  for (char& c : line) {
    if (c < 0x20 || c > 0x7e) c = '?';
  }
  return line;
}

// What came of describing one file: components, or why not.
struct Description {
  std::vector<ComponentInfo> components;
  PluginRefusal refusal;
  bool refused = false;
};

Description Describe(const std::string& file, const ScanOptions& options) {
  Description description;
  const auto refuse = [&](ExitCode code, const std::string& message) {
    description.refused = true;
    description.refusal = {file, code, message};
    return description;
  };
  std::string sha256;
  ChildResult child;
  try {
    // A folder or a named pipe called x.so has no digest; the child says what it is.
    if (std::filesystem::is_regular_file(file)) sha256 = Sha256HexOfFile(file);
    child = RunChild(file, options);
  } catch (const Failure& error) {
    return refuse(error.code(), error.what());
  }
  const std::string where = "plugin " + file + ": ";
  const std::string last = LastLine(child.errors);
  const std::string said = last.empty() ? "" : "; its last words: " + last;
  if (child.timed_out) {
    return refuse(ExitCode::kPluginCrashed,
                  where + "expected to load in " +
                      std::to_string(options.timeout.count() / 1000.0).substr(0, 4) +
                      " s, found it still loading; it was ended" + said);
  }
  if (!child.done && WIFSIGNALED(child.wait_status)) {
    const int signal = WTERMSIG(child.wait_status);
    return refuse(ExitCode::kPluginCrashed,
                  where + "crashed while it was loaded: " + ::strsignal(signal) + " (signal " +
                      std::to_string(signal) + ")" + said);
  }
  if (!child.done) {
    return refuse(ExitCode::kPluginCrashed,
                  where + "ended the process while it was loaded (exit status " +
                      std::to_string(WEXITSTATUS(child.wait_status)) + ")" + said);
  }
  try {
    const Json json = results::ParseJson(child.description);
    if (json.contains("refused")) {
      return refuse(static_cast<ExitCode>(json.at("refused").at("code").get<int>()),
                    json.at("refused").at("message").get<std::string>());
    }
    for (const Json& item : json.at("components")) {
      description.components.push_back(ComponentInfoFromJson(item));
      description.components.back().plugin.path = file;
      description.components.back().plugin.sha256 = sha256;
    }
  } catch (const Json::exception& error) {
    return refuse(ExitCode::kPluginCrashed,
                  where + "its description cannot be read: " + error.what() + said);
  }
  return description;
}

// Every entry of a folder called *.so, sorted.
std::vector<std::string> Libraries(const std::filesystem::path& folder) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".so") files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<Description> DescribeAll(const std::vector<std::string>& files,
                                     const ScanOptions& options) {
  std::vector<Description> descriptions(files.size());
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < files.size(); i = next++) {
      descriptions[i] = Describe(files[i], options);
    }
  };
  std::vector<std::jthread> threads;
  const auto count = std::min<std::size_t>(std::max(options.children, 1), files.size());
  for (std::size_t i = 0; i < count; ++i) threads.emplace_back(work);
  threads.clear();  // joins
  return descriptions;
}

std::string FolderNames(const std::vector<std::filesystem::path>& folders) {
  std::vector<std::string> names;
  for (const auto& folder : folders) names.push_back(folder.string());
  return names.empty() ? "no plugin folder (none exists)" : JoinNames(names);
}

// "mcts_pw" is called so in planner_mcts_pw.so and in mcts_pw.so.
bool IsCalled(const std::string& file, std::string_view name) {
  const std::string stem = std::filesystem::path(file).stem().string();
  return stem == name || stem.ends_with("_" + std::string(name));
}

// --- the child's side --------------------------------------------------------

// A library that allocates without end meets a limit instead of the machine's.
// The sanitizers reserve address space beyond any limit.
void LimitResources() {
  const rlimit none = {0, 0};
  ::setrlimit(RLIMIT_CORE, &none);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  constexpr rlim_t kMostData = rlim_t{1} << 30;
  const rlimit data = {kMostData, kMostData};
  ::setrlimit(RLIMIT_DATA, &data);
#endif
}

Json DescribePlugin(const std::string& file) {
  try {
    const PluginDescriptor& plugin = LoadPlugin(file);
    Json components = Json::array();
    for (const ComponentDescriptor& component : plugin.components) {
      ComponentInfo info = DescribeComponent(component);
      info.plugin = {plugin.name, plugin.version, file, "", plugin.sdk_major, plugin.sdk_minor};
      components.push_back(ToJson(info));
    }
    return {{"components", components}};
  } catch (const Failure& error) {
    return {{"refused", {{"code", error.exit_status()}, {"message", error.what()}}}};
  } catch (const std::exception& error) {
    return {{"refused",
             {{"code", static_cast<int>(ExitCode::kInternal)},
              {"message", "plugin " + file + ": " + error.what()}}}};
  }
}

}  // namespace

ParameterInfo DescribeParameter(const ParameterSpec& spec) {
  ParameterInfo info;
  info.name = spec.name;
  info.type = spec.type;
  info.default_number = spec.default_number;
  info.min = spec.min;
  info.max = spec.max;
  info.default_choice = TextOrEmpty(spec.default_choice);
  info.choices = SplitList(TextOrEmpty(spec.choices), ',');
  info.unit = TextOrEmpty(spec.unit);
  info.help = TextOrEmpty(spec.help);
  for (std::uint32_t i = 0; i < spec.preset_count; ++i) {
    const PresetValue& preset = spec.presets[i];
    info.presets.push_back({preset.preset, preset.number, TextOrEmpty(preset.choice)});
  }
  return info;
}

Json ToJson(const ComponentInfo& component) {
  Json parameters = Json::array();
  for (const ParameterInfo& p : component.parameters) {
    Json presets = Json::array();
    for (const PresetInfo& preset : p.presets) {
      presets.push_back(
          {{"preset", preset.preset}, {"number", preset.number}, {"choice", preset.choice}});
    }
    parameters.push_back({{"name", p.name},
                          {"type", static_cast<std::uint32_t>(p.type)},
                          {"default_number", p.default_number},
                          {"min", p.min},
                          {"max", p.max},
                          {"default_choice", p.default_choice},
                          {"choices", p.choices},
                          {"unit", p.unit},
                          {"help", p.help},
                          {"presets", presets}});
  }
  Json metrics = Json::array();
  for (const MetricInfo& metric : component.metrics) {
    metrics.push_back({{"name", metric.name}, {"unit", metric.unit}, {"help", metric.help}});
  }
  return {{"kind", static_cast<std::uint32_t>(component.kind)},
          {"name", component.name},
          {"aliases", component.aliases},
          {"version", component.version},
          {"summary", component.summary},
          {"traits", component.traits},
          {"parameters", parameters},
          {"metrics", metrics},
          {"plugin",
           {{"name", component.plugin.name},
            {"version", component.plugin.version},
            {"path", component.plugin.path},
            {"sha256", component.plugin.sha256},
            {"sdk_major", component.plugin.sdk_major},
            {"sdk_minor", component.plugin.sdk_minor}}}};
}

ComponentInfo ComponentInfoFromJson(const Json& json) {
  ComponentInfo info;
  info.kind = static_cast<ComponentKind>(json.at("kind").get<std::uint32_t>());
  json.at("name").get_to(info.name);
  json.at("aliases").get_to(info.aliases);
  json.at("version").get_to(info.version);
  json.at("summary").get_to(info.summary);
  json.at("traits").get_to(info.traits);
  for (const Json& item : json.at("parameters")) {
    ParameterInfo p;
    item.at("name").get_to(p.name);
    p.type = static_cast<ParameterType>(item.at("type").get<std::uint32_t>());
    item.at("default_number").get_to(p.default_number);
    item.at("min").get_to(p.min);
    item.at("max").get_to(p.max);
    item.at("default_choice").get_to(p.default_choice);
    item.at("choices").get_to(p.choices);
    item.at("unit").get_to(p.unit);
    item.at("help").get_to(p.help);
    for (const Json& preset : item.at("presets")) {
      p.presets.push_back({preset.at("preset").get<std::string>(),
                           preset.at("number").get<double>(),
                           preset.at("choice").get<std::string>()});
    }
    info.parameters.push_back(std::move(p));
  }
  for (const Json& item : json.at("metrics")) {
    info.metrics.push_back({item.at("name").get<std::string>(), item.at("unit").get<std::string>(),
                            item.at("help").get<std::string>()});
  }
  const Json& plugin = json.at("plugin");
  plugin.at("name").get_to(info.plugin.name);
  plugin.at("version").get_to(info.plugin.version);
  plugin.at("path").get_to(info.plugin.path);
  plugin.at("sha256").get_to(info.plugin.sha256);
  plugin.at("sdk_major").get_to(info.plugin.sdk_major);
  plugin.at("sdk_minor").get_to(info.plugin.sdk_minor);
  return info;
}

Catalogue Catalogue::Scan(const std::vector<std::filesystem::path>& folders,
                          const ScanOptions& options) {
  Catalogue catalogue;
  std::vector<std::string> files;
  std::vector<std::size_t> folder_of_file;
  for (const auto& folder : folders) {
    std::error_code error;
    const std::filesystem::path path = std::filesystem::canonical(folder, error);
    if (error || !std::filesystem::is_directory(path)) continue;
    if (std::find(catalogue.folders_.begin(), catalogue.folders_.end(), path) !=
        catalogue.folders_.end()) {
      continue;
    }
    try {
      const std::vector<std::string> found = Libraries(path);
      files.insert(files.end(), found.begin(), found.end());
    } catch (const std::filesystem::filesystem_error& failure) {
      catalogue.warnings_.push_back("plugin folder " + path.string() +
                                    " is skipped: " + failure.code().message());
      continue;
    }
    folder_of_file.resize(files.size(), catalogue.folders_.size());
    catalogue.folders_.push_back(path);
  }

  using Key = std::pair<ComponentKind, std::string>;
  struct Claim {
    std::size_t folder;
    PluginInfo plugin;
  };
  std::map<Key, Claim> claims;
  std::vector<Description> descriptions = DescribeAll(files, options);
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (descriptions[i].refused) {
      catalogue.refusals_.push_back(descriptions[i].refusal);
      continue;
    }
    for (ComponentInfo& component : descriptions[i].components) {
      const std::string kind = ComponentKindName(component.kind);
      // True if the name is this component's to use.
      const auto claim = [&](const std::string& name) {
        const Key key{component.kind, name};
        const auto [old, added] = claims.try_emplace(key, folder_of_file[i], component.plugin);
        if (added) return true;
        const PluginInfo& other = old->second.plugin;
        if (old->second.folder == folder_of_file[i]) {
          catalogue.ambiguous_.try_emplace(
              key, kind + " '" + name + "' is offered by two plugins of one folder, " + other.path +
                       " and " + component.plugin.path + "; remove one of them");
        } else if (other.sha256 != component.plugin.sha256) {
          catalogue.warnings_.push_back(kind + " '" + name + "' of " + component.plugin.path +
                                        " is hidden by the one of " + other.path);
        }
        return false;
      };
      if (!claim(component.name)) continue;
      std::erase_if(component.aliases, [&](const std::string& alias) { return !claim(alias); });
      catalogue.components_.push_back(std::make_shared<const ComponentInfo>(std::move(component)));
    }
  }
  for (const auto& [key, message] : catalogue.ambiguous_) catalogue.warnings_.push_back(message);
  std::erase_if(catalogue.components_, [&](const auto& component) {
    return catalogue.ambiguous_.contains({component->kind, component->name});
  });
  std::sort(catalogue.components_.begin(), catalogue.components_.end(),
            [](const auto& a, const auto& b) {
              return std::tie(a->kind, a->name) < std::tie(b->kind, b->name);
            });
  return catalogue;
}

std::shared_ptr<const ComponentInfo> Catalogue::Find(ComponentKind kind,
                                                     std::string_view name) const {
  const std::string text(name);
  if (const auto both = ambiguous_.find({kind, text}); both != ambiguous_.end()) {
    throw Failure(ExitCode::kPluginRefused, both->second);
  }
  std::vector<std::string> known;
  for (const auto& component : components_) {
    if (component->kind != kind) continue;
    const auto& aliases = component->aliases;
    if (component->name == name ||
        std::find(aliases.begin(), aliases.end(), text) != aliases.end()) {
      return component;
    }
    known.push_back(component->name);
  }
  std::vector<std::string> refused;
  for (const PluginRefusal& refusal : refusals_) {
    if (IsCalled(refusal.path, name)) throw Failure(refusal.code, refusal.message);
    refused.push_back(std::filesystem::path(refusal.path).filename().string());
  }
  std::string message = std::string("no ") + ComponentKindName(kind) + " '" + text + "' in " +
                        FolderNames(folders_) + ". " + KnownNames(name, known);
  if (!refused.empty()) {
    message += " Refused: " + JoinNames(refused) + " (`runner list` says why).";
  }
  throw Failure(ExitCode::kNotFound, message);
}

std::shared_ptr<const ComponentInfo> Catalogue::DefaultModel(bool learns) const {
  std::vector<std::string> found;
  for (const std::string& name : NamesOf(ComponentKind::kModel, kDefault)) {
    if (Find(ComponentKind::kModel, name)->Has(kLearns) == learns) found.push_back(name);
  }
  if (found.size() == 1) return Find(ComponentKind::kModel, found.front());
  if (found.empty()) {
    throw Failure(ExitCode::kNotFound, "no plugin in " + FolderNames(folders_) +
                                           " has a model that is taken where " +
                                           "none is named; expected --model NAME. Known: " +
                                           JoinNames(NamesOf(ComponentKind::kModel)) + ".");
  }
  throw Failure(ExitCode::kUsage, "expected --model NAME: " + JoinNames(found) +
                                      " each declare that they are taken where none is named");
}

std::vector<std::string> Catalogue::NamesOf(ComponentKind kind, std::uint32_t traits) const {
  std::vector<std::string> names;
  for (const auto& component : components_) {
    if (component->kind == kind && (component->traits & traits) == traits) {
      names.push_back(component->name);
    }
  }
  return names;
}

std::vector<std::filesystem::path> PluginFolders(const std::vector<std::string>& first) {
  std::vector<std::filesystem::path> folders;
  const auto add = [&](const std::filesystem::path& folder) {
    const auto path = std::filesystem::absolute(folder).lexically_normal();
    if (std::find(folders.begin(), folders.end(), path) == folders.end()) folders.push_back(path);
  };
  for (const std::string& entry : first) {
    for (const std::string& folder : SplitList(entry, ':')) {
      std::error_code error;
      if (!std::filesystem::is_directory(folder, error)) {
        throw Failure(
            ExitCode::kNotFound,
            "--plugin-path: expected a folder, found " +
                std::filesystem::absolute(folder).string() +
                (std::filesystem::exists(folder, error) ? ", a file" : ", which does not exist"));
      }
      add(folder);
    }
  }
  if (const char* variable = std::getenv("DREAMSEARCH_PLUGIN_PATH"); variable != nullptr) {
    for (const std::string& folder : SplitList(variable, ':')) add(folder);
  }
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (!error) add(program.parent_path().parent_path() / "lib/dreamsearch/plugins");
  return folders;
}

int DescribePluginMain(const std::string& file) {
  if (::fcntl(kDescribeDescriptor, F_SETFD, FD_CLOEXEC) != 0) {
    std::fprintf(stderr, "runner: describe-plugin is for the runner's own use; see runner list\n");
    return static_cast<int>(ExitCode::kUsage);
  }
  // Should the parent be killed, a library that hangs ends with it.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  LimitResources();
  std::string text = results::JsonTextReplacing(DescribePlugin(file));
  text += kDoneToken;
  const bool written = WriteAll(kDescribeDescriptor, text);
  // Without exit handlers: the library's own might crash.
  ::_exit(written ? 0 : static_cast<int>(ExitCode::kInputOutput));
}

}  // namespace dreamsearch
