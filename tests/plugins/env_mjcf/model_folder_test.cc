// Which files a model may reach, and what becomes of a bad model.
#include "plugins/env_mjcf/model_folder.h"

#include <gtest/gtest.h>

#include "tests/plugins/env_mjcf/model_files.h"

namespace dreamsearch::mjcf {
namespace {

constexpr char kBall[] = "<mujoco><worldbody><geom name='ball' size='1'/></worldbody></mujoco>";
constexpr char kTetrahedron[] =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
constexpr char kTetrahedronSha256[] =
    "b391f08159e507ad3a0fa80558bdb046e150e38868378c9972072d54ad65f858";

std::string WithMesh(const std::string& compiler, const std::string& file) {
  return "<mujoco><compiler " + compiler + "/><asset><mesh name='m' file='" + file +
         "'/></asset><worldbody><geom type='mesh' mesh='m'/></worldbody></mujoco>";
}

TEST(CompileInFolder, TakesIncludesAndAssetsOfItsFolderAndBelow) {
  const ModelFiles files;
  files.Write("parts/ball.xml", kBall);
  files.Write("meshes/m.obj", kTetrahedron);
  files.Write("m.obj", kTetrahedron);
  const std::string models[] = {
      kBall,
      "<mujoco><include file='parts/ball.xml'/></mujoco>",
      "<mujoco><include file='./parts/../parts/ball.xml'/></mujoco>",
      WithMesh("meshdir='meshes'", "m.obj"),
      WithMesh("meshdir=''", "meshes/m.obj"),
      WithMesh("coordinate='local'", "m.obj"),
  };
  for (const std::string& model : models) {
    const std::string path = files.Write("model.xml", model);
    EXPECT_EQ(MessageOf([&] { EXPECT_EQ(CompileInFolder(path).model->ngeom, 1); }), "") << model;
  }
}

TEST(CompileInFolder, DigestsEveryFileThatItReads) {
  const ModelFiles files;
  files.Write("parts/ball.xml", kBall);
  files.Write("parts/m.obj", kTetrahedron);
  files.Write("unused.obj", kTetrahedron);
  const std::string path = files.Write(
      "model.xml",
      "<mujoco><include file='parts/ball.xml'/><asset><mesh name='m' file='parts/m.obj'/></asset>"
      "<worldbody><geom type='mesh' mesh='m'/></worldbody></mujoco>");
  const auto digests = CompileInFolder(path).files;
  ASSERT_EQ(digests.size(), 2u);  // the model's own is the setting's
  // sha256sum of the text above
  EXPECT_EQ(digests.at("parts/m.obj"), kTetrahedronSha256);
  files.Write("parts/ball.xml", std::string(kBall) + "\n");
  const auto changed = CompileInFolder(path).files;
  EXPECT_NE(changed.at("parts/ball.xml"), digests.at("parts/ball.xml"));
  EXPECT_EQ(changed.at("parts/m.obj"), digests.at("parts/m.obj"));
}

TEST(CompileInFolder, RefusesAllThatLeadsOutside) {
  const ModelFiles files;
  // Files that exist, so that only the check stands between model and file.
  files.Write("outside.xml", kBall);
  files.Write("outside.obj", kTetrahedron);
  const std::string outside = (files.folder() / "outside.xml").string();
  files.Write("inside/deep/back.xml", "<mujoco><include file='../../outside.xml'/></mujoco>");
  files.Write("inside/material.obj", "mtllib ../../etc/passwd\n" + std::string(kTetrahedron));
  std::filesystem::create_symlink(outside, files.folder() / "inside/link.xml");
  std::filesystem::create_directory_symlink(files.folder(), files.folder() / "inside/up");
  const std::string models[] = {
      "<mujoco><include file='../outside.xml'/></mujoco>",
      "<mujoco><include file='" + outside + "'/></mujoco>",
      "<mujoco><include file='/etc/passwd'/></mujoco>",
      "<mujoco><include file='deep/../../outside.xml'/></mujoco>",
      "<mujoco><include file='deep/back.xml'/></mujoco>",
      "<mujoco><include file='link.xml'/></mujoco>",
      "<mujoco><include file='up/outside.xml'/></mujoco>",
      "<mujoco><include file='&#46;&#46;/outside.xml'/></mujoco>",
      "<mujoco><include\n file \n = \"../outside.xml\"/></mujoco>",
      WithMesh("meshdir='..'", "outside.obj"),
      WithMesh("meshdir='" + files.folder().string() + "'", "outside.obj"),
      WithMesh("meshdir='deep'", "../../outside.obj"),
      WithMesh("meshdir='up'", "outside.obj"),
      WithMesh("coordinate='local'", "material.obj"),
      "<mujoco><asset><texture name='t' type='2d' file='../t.png'/></asset></mujoco>",
      "<mujoco><asset><hfield name='h' file='/tmp/h.png' size='1 1 1 1'/></asset></mujoco>",
      "<mujoco><asset><skin name='s' file='../../s.skn'/></asset></mujoco>",
      "<robot name='r'><link name='l'><visual><geometry><mesh filename='package://x/m.stl'/>"
      "</geometry></visual></link></robot>",
  };
  for (const std::string& model : models) {
    const std::string path = files.Write("inside/model.xml", model);
    const std::string message = MessageOf([&] { CompileInFolder(path); });
    EXPECT_TRUE(message.find("refers to") != std::string::npos) << model << "\n" << message;
    EXPECT_EQ(message.find("does not compile"), std::string::npos) << model << "\n" << message;
  }
}

TEST(CompileInFolder, SaysWhatIsMissingOrWrong) {
  const ModelFiles files;
  const auto message = [&](const std::string& text) {
    const std::string path = files.Write("model.xml", text);
    return MessageOf([&] { CompileInFolder(path); });
  };
  EXPECT_NE(message(WithMesh("coordinate='local'", "cow.stl"))
                .find("refers to file=\"cow.stl\", and there is no such file in "),
            std::string::npos);
  for (const char* text :
       {"", "<mujoco>", "not XML", "<mujoco><nonsense/></mujoco>",
        "<mujoco><worldbody><geom size='-1'/></worldbody></mujoco>",
        "<mujoco><worldbody><body><joint range='0 1'/></body></worldbody></mujoco>",
        "<mujoco><include file='model.xml'/></mujoco>"}) {
    EXPECT_NE(message(text).find("model.xml does not compile with MuJoCo "), std::string::npos)
        << text << "\n"
        << message(text);
  }
  // An attribute of MuJoCo 3: the message has the version that was asked and the attribute.
  const std::string newer = message(
      "<mujoco><worldbody><body gravcomp='1'><joint/><geom size='1'/></body></worldbody></mujoco>");
  EXPECT_NE(newer.find("MuJoCo 2.2.2"), std::string::npos) << newer;
  EXPECT_NE(newer.find("gravcomp"), std::string::npos) << newer;
  EXPECT_NE(MessageOf([&] {
              CompileInFolder(files.folder() / "absent/model.xml");
            }).find("its folder cannot be read"),
            std::string::npos);
}

}  // namespace
}  // namespace dreamsearch::mjcf
