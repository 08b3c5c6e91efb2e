// Scanning folders of libraries, good and bad, in child processes.
#include "host/plugins/catalogue.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "host/commands/commands.h"
#include "results/system/error.h"
#include "results/system/sha256.h"
#include "results/text/json_fields.h"
#include "tests/host/plugins/library_folder.h"

namespace dreamsearch {
namespace {

using namespace std::chrono_literals;

ScanOptions Patient() {
  ScanOptions options;
  options.timeout = 60s;  // for libraries that end by themselves, on a busy machine
  return options;
}

ScanOptions Impatient() {
  ScanOptions options;
  options.timeout = 1500ms;  // for libraries that never do
  return options;
}

// The refusal of a folder with this library alone.
PluginRefusal RefusalOf(const std::string& name, const ScanOptions& options) {
  const LibraryFolder folder;
  folder.Copy(Corpus(name), name + ".so");
  const Catalogue catalogue = Catalogue::Scan({folder.path()}, options);
  EXPECT_TRUE(catalogue.components().empty()) << name;
  if (catalogue.refusals().size() != 1) return {"", ExitCode::kOk, "not refused"};
  EXPECT_EQ(catalogue.refusals()[0].path, (folder.path() / (name + ".so")).string());
  return catalogue.refusals()[0];
}

void ExpectRefusal(const std::string& name, const ScanOptions& options, ExitCode code,
                   const std::vector<std::string>& parts) {
  SCOPED_TRACE(name);
  const PluginRefusal refusal = RefusalOf(name, options);
  EXPECT_EQ(refusal.code, code) << refusal.message;
  EXPECT_NE(refusal.message.find(name + ".so"), std::string::npos) << refusal.message;
  for (const std::string& part : parts) {
    EXPECT_NE(refusal.message.find(part), std::string::npos)
        << "expected '" << part << "' in: " << refusal.message;
  }
}

std::size_t OpenDescriptors() {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    ++count;
  }
  return count;
}

TEST(Catalogue, DescribesEveryFieldOfAComponent) {
  const LibraryFolder folder;
  const auto file = folder.Copy(Corpus("good"), "good.so");
  const Catalogue catalogue = Catalogue::Scan({folder.path()}, Patient());
  EXPECT_TRUE(catalogue.refusals().empty());
  ASSERT_EQ(catalogue.components().size(), 2u);
  const auto planner = catalogue.Find(ComponentKind::kPlanner, "good");
  EXPECT_EQ(catalogue.Find(ComponentKind::kPlanner, "fine"), planner);
  EXPECT_EQ(planner->version, "1.0.0");
  EXPECT_EQ(planner->aliases, (std::vector<std::string>{"fine", "well"}));
  EXPECT_EQ(planner->plugin.name, "good");
  EXPECT_EQ(planner->plugin.version, "1.2.3");
  EXPECT_EQ(planner->plugin.path, file.string());
  EXPECT_EQ(planner->plugin.sha256, Sha256HexOfFile(file));
  EXPECT_EQ(planner->plugin.sdk_major, std::uint32_t{DREAMSEARCH_SDK_MAJOR});
  EXPECT_EQ(planner->plugin.sdk_minor, std::uint32_t{DREAMSEARCH_SDK_MINOR});
  ASSERT_EQ(planner->parameters.size(), 4u);
  EXPECT_EQ(planner->parameters[0].name, "noise");
  EXPECT_EQ(planner->parameters[0].default_number, 0.3);
  ASSERT_EQ(planner->parameters[0].presets.size(), 1u);
  EXPECT_EQ(planner->parameters[0].presets[0].number, 0.25);
  EXPECT_EQ(planner->parameters[1].unit, "simulations");
  EXPECT_EQ(planner->parameters[1].max, 1000000);
  EXPECT_EQ(planner->parameters[3].choices, (std::vector<std::string>{"parent", "zero"}));
  EXPECT_EQ(planner->parameters[3].default_choice, "parent");
  ASSERT_EQ(planner->metrics.size(), 1u);
  EXPECT_EQ(planner->metrics[0].unit, "nat");
  EXPECT_TRUE(planner->Has(kSearches));
  EXPECT_FALSE(planner->Has(kActorAlone));
  EXPECT_EQ(catalogue.Find(ComponentKind::kModel, "good")->traits, kNeedsEnvironment | kDefault);
  EXPECT_EQ(catalogue.DefaultModel(false)->name, "good");
  const nlohmann::json json = results::FieldsToJson(*planner);
  EXPECT_EQ(results::FieldsToJson(results::FieldsFromJson<ComponentInfo>(json)), json);
  EXPECT_EQ(json["parameters"][0]["presets"][0]["number"], 0.25);
}

TEST(Catalogue, RefusesLibrariesThatEndTheProcess) {
  const ScanOptions options = Patient();
  ExpectRefusal("static_throws", options, ExitCode::kPluginCrashed,
                {"crashed while it was loaded", "no licence found"});
  ExpectRefusal("static_aborts", options, ExitCode::kPluginCrashed, {"signal 6"});
  ExpectRefusal("static_exits", options, ExitCode::kPluginCrashed,
                {"ended the process while it was loaded (exit status 0)"});
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  ExpectRefusal("segfaults", options, ExitCode::kPluginCrashed, {"signal 11"});
  ExpectRefusal("overflows_stack", options, ExitCode::kPluginCrashed, {"signal 11"});
  ExpectRefusal("allocates_without_end", options, ExitCode::kPluginCrashed, {"bad_alloc"});
#endif
  ExpectRefusal("closes_descriptors", options, ExitCode::kPluginCrashed, {"while it was loaded"});
}

TEST(Catalogue, EndsALibraryThatHangs) {
  for (const char* name : {"static_hangs", "stops_itself"}) {
    const auto begin = std::chrono::steady_clock::now();
    ExpectRefusal(name, Impatient(), ExitCode::kPluginCrashed, {"expected to load in 1.50 s"});
    EXPECT_LT(std::chrono::steady_clock::now() - begin, 10s) << name;
  }
}

TEST(Catalogue, RefusesWhatTheLoaderRefuses) {
  const ScanOptions options = Patient();
  ExpectRefusal("fast_math", options, ExitCode::kPluginRefused, {"-ffast-math"});
  ExpectRefusal("missing_symbol", options, ExitCode::kPluginRefused,
                {"dreamsearch_test_defined_nowhere"});
  ExpectRefusal("unknown_kind", options, ExitCode::kPluginRefused, {"found 9"});
  ExpectRefusal("duplicate_component", options, ExitCode::kPluginRefused,
                {"two components offer the planner 'twice'"});
}

TEST(Catalogue, IsNotConfusedByALibraryThatPrintsMuch) {
  const LibraryFolder folder;
  folder.Copy(Corpus("prints_much"), "prints_much.so");
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  const Catalogue catalogue = Catalogue::Scan({folder.path()}, Patient());
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_TRUE(catalogue.refusals().empty());
  EXPECT_EQ(catalogue.Find(ComponentKind::kPlanner, "prints_much")->name, "prints_much");
}

TEST(Catalogue, LeavesNoProcessBehind) {
  const LibraryFolder folder;
  const std::string pid_file = (folder.path() / "pid").string();
  ::setenv("DREAMSEARCH_TEST_PID_FILE", pid_file.c_str(), 1);
  ExpectRefusal("leaves_a_child", Patient(), ExitCode::kPluginCrashed, {"exit status 3"});
  ::unsetenv("DREAMSEARCH_TEST_PID_FILE");
  int pid = 0;
  std::ifstream(pid_file) >> pid;
  ASSERT_GT(pid, 1);
  // Its new parent has to notice that it was killed.
  bool gone = false;
  for (int i = 0; i < 500 && !gone; ++i) {
    std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
    std::string number, name, state;
    gone = !(stat >> number >> name >> state) || state == "Z";
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_TRUE(gone) << "process " << pid << " is still running";
}

TEST(Catalogue, FinishesTheCorpusAndFindsTheGoodOnes) {
  const LibraryFolder folder;
  std::size_t bad = 0;
  for (const auto& entry : std::filesystem::directory_iterator(DREAMSEARCH_CORPUS_DIR)) {
    const std::string name = entry.path().stem().string();
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    if (name == "allocates_without_end") continue;
#endif
    if (entry.path().extension() != ".so" || name == "good_twin") continue;
    folder.Copy(entry.path(), name + ".so");
    bad += name == "good" || name == "prints_much" ? 0 : 1;
  }
  std::filesystem::create_directory(folder.path() / "folder.so");
  folder.Write("empty.so", "");
  folder.Write("text.so", "hello\n");
  folder.Write("not_a_plugin.txt", "hello\n");
  std::filesystem::create_symlink("nowhere", folder.path() / "dangling.so");
  bad += 4;

  const std::size_t descriptors = OpenDescriptors();
  ScanOptions options;
  options.timeout = 5s;
  const Catalogue catalogue = Catalogue::Scan({folder.path()}, options);
  EXPECT_EQ(catalogue.refusals().size(), bad);
  EXPECT_EQ(catalogue.components().size(), 3u);
  EXPECT_EQ(OpenDescriptors(), descriptors);
  EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1);
  EXPECT_EQ(errno, ECHILD);
  for (const PluginRefusal& refusal : catalogue.refusals()) {
    EXPECT_TRUE(refusal.code == ExitCode::kPluginRefused ||
                refusal.code == ExitCode::kPluginCrashed || refusal.code == ExitCode::kNotFound)
        << refusal.message;
    EXPECT_EQ(refusal.message.find('\n'), std::string::npos) << refusal.message;
    EXPECT_NE(refusal.message.find(refusal.path), std::string::npos) << refusal.message;
  }
  // A refused library's own name leads to its refusal, not to "no such planner".
  try {
    catalogue.Find(ComponentKind::kPlanner, "static_aborts");
    FAIL() << "static_aborts was found";
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kPluginCrashed);
  }
}

// A program that cannot describe shows that it was not asked.
TEST(Catalogue, AFileThatIsKnownIsNotStartedUnlessItHasChanged) {
  const LibraryFolder folder;
  folder.Copy(Corpus("good"), "good.so");
  const Catalogue first = Catalogue::Scan({folder.path()}, Patient());
  ASSERT_FALSE(first.components().empty());
  ScanOptions options = Patient();
  options.program = "/bin/false";
  options.known = results::FieldsFromJson<KnownPlugins>(results::FieldsToJson(first.described()));
  const Catalogue again = Catalogue::Scan({folder.path()}, options);
  ASSERT_EQ(again.components().size(), first.components().size());
  EXPECT_EQ(results::FieldsToJson(*again.components()[0]),
            results::FieldsToJson(*first.components()[0]));

  std::ofstream(folder.path() / "good.so", std::ios::app) << "more";
  const Catalogue changed = Catalogue::Scan({folder.path()}, options);
  EXPECT_TRUE(changed.components().empty());
  EXPECT_EQ(changed.refusals().size(), 1u);
}

TEST(Catalogue, WhatIsNoListOfKnownPluginsIsNone) {
  const LibraryFolder folder;
  for (const char* text : {"", "{", "[]", R"({"plugins":[{}]})"}) {
    std::ofstream(folder.path() / "plugins.json") << text;
    ::setenv(kKnownPluginsVariable, (folder.path() / "plugins.json").c_str(), 1);
    EXPECT_TRUE(ReadKnownPlugins().plugins.empty()) << text;
  }
  ::setenv(kKnownPluginsVariable, "/nowhere", 1);
  EXPECT_TRUE(ReadKnownPlugins().plugins.empty());
  ::unsetenv(kKnownPluginsVariable);
  EXPECT_TRUE(ReadKnownPlugins().plugins.empty());
}

TEST(Catalogue, SaysWhichNamesAreKnown) {
  const LibraryFolder folder;
  folder.Copy(Corpus("good"), "good.so");
  folder.Write("broken.so", "hello\n");
  const Catalogue catalogue = Catalogue::Scan({folder.path()}, Patient());
  try {
    catalogue.Find(ComponentKind::kPlanner, "godo");
    FAIL() << "godo was found";
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kNotFound);
    EXPECT_EQ(std::string(error.what()), "no planner 'godo' in " +
                                             std::filesystem::canonical(folder.path()).string() +
                                             ". Known: good. Did you mean good? Refused: " +
                                             catalogue.refusals().front().message + ".");
  }
  EXPECT_THROW(catalogue.Find(ComponentKind::kEnvironment, "good"), Failure);
}

TEST(Catalogue, WhoForgotTheFolderOfHisPluginIsToldHowToNameIt) {
  const LibraryFolder folder, project;
  folder.Copy(Corpus("good"), "good.so");
  project.Write("mine.cc", "// no library");
  const Catalogue catalogue = Catalogue::Scan({project.path(), folder.path()}, Patient());
  try {
    catalogue.Find(ComponentKind::kPlanner, "quite_another");
    FAIL() << "quite_another was found";
  } catch (const Failure& error) {
    EXPECT_EQ(std::string(error.what()),
              "no planner 'quite_another' in " +
                  std::filesystem::canonical(project.path()).string() + " (no .so there), " +
                  std::filesystem::canonical(folder.path()).string() +
                  ". Known: good. Plugins of your own are found with --plugin-path FOLDER.");
  }
}

TEST(Catalogue, TheEarlierFolderWinsWithAWarning) {
  const LibraryFolder first, second;
  first.Copy(Corpus("good"), "good.so");
  second.Copy(Corpus("good_twin"), "good_twin.so");
  const Catalogue one = Catalogue::Scan({first.path(), second.path()}, Patient());
  EXPECT_EQ(one.Find(ComponentKind::kPlanner, "good")->plugin.name, "good");
  ASSERT_EQ(one.warnings().size(), 1u);
  EXPECT_NE(one.warnings()[0].find("good_twin.so is hidden by"), std::string::npos)
      << one.warnings()[0];
  const Catalogue other = Catalogue::Scan({second.path(), first.path()}, Patient());
  EXPECT_EQ(other.Find(ComponentKind::kPlanner, "good")->plugin.name, "good_twin");
  // The hidden plugin's other components stay.
  EXPECT_EQ(other.Find(ComponentKind::kModel, "good")->plugin.name, "good");
}

TEST(Catalogue, OneNameTwiceInAFolderIsAnErrorNamingBoth) {
  const LibraryFolder folder;
  folder.Copy(Corpus("good"), "good.so");
  folder.Copy(Corpus("good_twin"), "good_twin.so");
  const Catalogue catalogue = Catalogue::Scan({folder.path()}, Patient());
  try {
    catalogue.Find(ComponentKind::kPlanner, "good");
    FAIL() << "one of two was chosen";
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kPluginRefused);
    const std::string message = error.what();
    EXPECT_NE(message.find("good.so"), std::string::npos) << message;
    EXPECT_NE(message.find("good_twin.so"), std::string::npos) << message;
  }
  EXPECT_EQ(catalogue.Find(ComponentKind::kModel, "good")->plugin.name, "good");
  EXPECT_EQ(catalogue.warnings().size(), 1u);
}

TEST(PluginFolders, AreTheGivenThenTheVariablesThenTheInstalled) {
  const LibraryFolder given, variable;
  ::setenv("DREAMSEARCH_PLUGIN_PATH",
           (variable.path().string() + ":" + given.path().string()).c_str(), 1);
  const auto folders = PluginFolders({given.path().string()});
  ::unsetenv("DREAMSEARCH_PLUGIN_PATH");
  ASSERT_EQ(folders.size(), 3u);
  EXPECT_EQ(folders[0], given.path());
  EXPECT_EQ(folders[1], variable.path());
  EXPECT_TRUE(folders[2].string().ends_with("/lib/dreamsearch/plugins")) << folders[2];
}

TEST(PluginFolders, AGivenFolderMustExist) {
  const LibraryFolder folder;
  try {
    PluginFolders({(folder.path() / "nowhere").string()});
    FAIL() << "accepted";
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kNotFound);
    EXPECT_NE(std::string(error.what()).find("nowhere"), std::string::npos) << error.what();
  }
}

// FIPS 180-2, appendix B.1, and the digest of nothing.
TEST(Sha256, GivesThePublishedDigests) {
  EXPECT_EQ(Sha256Hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(Sha256Hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  const LibraryFolder folder;
  EXPECT_EQ(Sha256HexOfFile(folder.Write("x", "abc")), Sha256Hex("abc"));
}

TEST(ListCommand, ShowsComponentsAndWhyOthersWereRefused) {
  const LibraryFolder folder;
  folder.Copy(Corpus("good"), "good.so");
  folder.Write("broken.so", "hello\n");
  testing::internal::CaptureStdout();
  EXPECT_EQ(ListCommand().Call({"--plugin-path", folder.path().string()}), 0);
  const std::string text = testing::internal::GetCapturedStdout();
  for (const char* part :
       {"environments\n  none\n", "models\n", "planners\n", "good 1.2.3", "(also fine, well)",
        "refused\n", "broken.so", "text beginning 'hello'"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << " in\n" << text;
  }
  EXPECT_THROW(ListCommand().Call({"planer"}), Failure);
  EXPECT_THROW(ListCommand().Call({"planners", "models"}), Failure);
}

TEST(DescribeCommand, ShowsEveryDeclaration) {
  const LibraryFolder folder;
  folder.Copy(Corpus("good"), "good.so");
  const std::string path = folder.path().string();
  testing::internal::CaptureStdout();
  EXPECT_EQ(DescribeCommand().Call({"good", "--plugin-path", path}), 0);
  const std::string both = testing::internal::GetCapturedStdout();
  for (const char* part : {"model good 0.9.0", "planner good 1.0.0", "simulations", "1 .. 1000000",
                           "parent, zero", "paper=0.25", "Exploration noise.", "entropy"}) {
    EXPECT_NE(both.find(part), std::string::npos) << part << " in\n" << both;
  }
  testing::internal::CaptureStdout();
  EXPECT_EQ(DescribeCommand().Call({"--plugin-path", path, "model/good"}), 0);
  EXPECT_EQ(testing::internal::GetCapturedStdout().find("planner good"), std::string::npos);
  try {
    DescribeCommand().Call({"--plugin-path", path, "gud"});
    FAIL() << "described";
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kNotFound);
    EXPECT_NE(std::string(error.what()).find("Known: run, model/good, planner/good."),
              std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace dreamsearch
