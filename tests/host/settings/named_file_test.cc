// Files that settings name, and factors of variation.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "host/settings/settings.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/sha256.h"
#include "results/system/temporary_folder.h"
#include "tests/host/refusal.h"
#include "tests/host/settings/test_catalogue.h"

namespace dreamsearch {
namespace {

// --- files ---------------------------------------------------------------------

class NamedFile : public testing::Test {
 protected:
  NamedFile() {
    std::filesystem::create_directories(folder_ / "worlds");
    WriteFile((folder_ / "worlds/ball.xml").string(), "<mujoco/>");
    WriteFile((folder_ / "world.py").string(), "pass");
  }

  static RunSpec Bridge(const Setting& setting) {
    RunOptions options = Base();
    options.environments = {"bridge"};
    options.settings = {setting};
    return Resolve(options);
  }
  Setting InFolder(const std::string& key, const std::string& value) const {
    return {key, value, true, "/x.cfg, line 3", folder_};
  }
  static void ExpectNoFile(const Setting& setting, const std::vector<std::string>& parts) {
    ExpectRefusal([&] { Bridge(setting); }, ExitCode::kNotFound, parts);
  }

  const TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
};

TEST_F(NamedFile, IsRelativeToTheFolderOfTheFileThatNamesIt) {
  const RunSpec spec = Bridge(InFolder("env.model", "worlds/../worlds/ball.xml"));
  const ResolvedValue& model = *spec.environment.parameters.Find("model");
  EXPECT_EQ(model.choice, (folder_ / "worlds/ball.xml").string());
  EXPECT_EQ(model.sha256, Sha256Hex("<mujoco/>"));
  EXPECT_EQ(Bridge(CommandLine("env.model", (folder_ / "worlds/ball.xml").string()))
                .environment.parameters.Find("model")
                ->choice,
            model.choice);
}

TEST_F(NamedFile, IsRelativeToTheWorkingDirectoryOnTheCommandLine) {
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder_ / "worlds");
  const RunSpec spec = Bridge(CommandLine("env.model", "ball.xml"));
  std::filesystem::current_path(before);
  EXPECT_EQ(spec.environment.parameters.Find("model")->choice,
            std::filesystem::canonical(folder_ / "worlds/ball.xml").string());
}

TEST_F(NamedFile, ThatIsNotThereOrIsNoneIsRefused) {
  ExpectNoFile(InFolder("env.model", "ball.xml"),
               {"/x.cfg, line 3: env.model: expected a file, found nothing: ",
                (folder_ / "ball.xml").string()});
  ExpectNoFile(InFolder("env.model", "worlds"), {"expected a file, found a folder: "});
  ExpectNoFile(InFolder("env.model", "worlds/ball.xml/ball.xml"), {"expected a file, found"});
  ExpectNoFile(InFolder("env.model", "/dev/null"), {"found what is no regular file: /dev/null"});
  ExpectNoFile(InFolder("env.module", "absent.py"), {"expected a file, found nothing: "});
  if (geteuid() != 0) {
    std::filesystem::permissions(folder_ / "world.py", std::filesystem::perms::none);
    ExpectNoFile(InFolder("env.module", "world.py"), {"one that cannot be read"});
  }
}

TEST_F(NamedFile, MayBeANameWhereTheEndingSaysSo) {
  const RunSpec name = Bridge(InFolder("env.module", "package.world"));
  EXPECT_EQ(name.environment.parameters.Choice("module"), "package.world");
  EXPECT_EQ(name.environment.parameters.Find("module")->sha256, "");
  const RunSpec file = Bridge(InFolder("env.module", "world.py"));
  EXPECT_EQ(file.environment.parameters.Choice("module"), (folder_ / "world.py").string());
  const RunSpec none = Bridge(InFolder("env.model", ""));
  EXPECT_EQ(none.environment.parameters.Choice("model"), "");
}

TEST_F(NamedFile, ThatChangedIsFoundAsAChangedPluginIs) {
  const RunSpec then = Bridge(InFolder("env.model", "worlds/ball.xml"));
  EXPECT_EQ(ChangedFile(then), "");
  WriteFile((folder_ / "worlds/ball.xml").string(), "<mujoco model='other'/>");
  const std::string change = ChangedFile(then);
  EXPECT_NE(change.find("file " + (folder_ / "worlds/ball.xml").string() + " changed (SHA-256 " +
                        Sha256Hex("<mujoco/>").substr(0, 12) + " then, "),
            std::string::npos)
      << change;
  const RunSpec now = Bridge(InFolder("env.model", "worlds/ball.xml"));
  EXPECT_EQ(ChangedSince(now, DigestsOf(then)), change);
  EXPECT_EQ(ConfigurationSha256(now), ConfigurationSha256(then));  // so that it is the same run
  RunSpec anew = then;
  EXPECT_EQ(DigestFilesAnew(&anew.environment.parameters), change);
  EXPECT_EQ(ChangedSince(anew, DigestsOf(now)), "");
}

TEST_F(NamedFile, SurvivesTheWayToAnotherProcess) {
  const RunSpec spec = Bridge(InFolder("env.model", "worlds/ball.xml"));
  EXPECT_EQ(DigestsOf(RunSpecFromJson(ToJson(spec))), DigestsOf(spec));
}

// --- a changed world -------------------------------------------------------------

TEST(Variation, IsAllThatATrainedRunsEvaluationMaySetOfItsTask) {
  RunOptions options = Base();
  options.environments = {"bridge"};
  const RunSpec trained = Resolve(options);
  options.evaluate = true;
  options.settings = {CommandLine("env.gravity", "2")};
  const RunSpec changed = ResolveMatrix(options, TestCatalogue(), &trained).at(0);
  EXPECT_EQ(changed.environment.parameters.Number("gravity"), 2);
  options.settings = {CommandLine("env.size", "2")};
  ExpectRefusal([&] { ResolveMatrix(options, TestCatalogue(), &trained); }, ExitCode::kUsage,
                {"env.size: expected a factor of variation (env.gravity), because the trained run "
                 "keeps its task"});
  options.environments = {"walker_walk"};
  options.settings = {CommandLine("env.sparse", "true")};
  ExpectRefusal([&] { ResolveMatrix(options, TestCatalogue(), &trained); }, ExitCode::kUsage,
                {"env.sparse: expected a factor of variation, of which this task has none"});
}

TEST(Variation, IsNoPartOfAConfigurationAtItsDefault) {
  RunOptions options = Base();
  options.environments = {"bridge"};
  EXPECT_EQ(CanonicalJson(Resolve(options)).find("gravity"), std::string::npos);
  options.settings = {CommandLine("env.gravity", "1")};
  EXPECT_EQ(CanonicalJson(Resolve(options)).find("gravity"), std::string::npos);
  options.settings = {CommandLine("env.gravity", "1.5")};
  EXPECT_NE(CanonicalJson(Resolve(options)).find("\"gravity\":1.5"), std::string::npos);
}

}  // namespace
}  // namespace dreamsearch
