// Compiling models: what they may refer to, and what becomes of a bad one.
#include "plugins/mujoco/engine.h"

#include <gtest/gtest.h>

#include <fstream>

#include "model_files.h"

namespace dreamsearch::dmc {
namespace {

using mujoco::EngineError;
using mujoco::ModelPtr;

ModelPtr CompileModel(const std::string& name, const std::string& mjcf) {
  return mujoco::CompileModel(name, mjcf, ModelFiles());
}

// The model's text with one asset or include.
std::string WithAsset(const std::string& asset) {
  return "<mujoco><asset>" + asset + "</asset><worldbody><geom size='1'/></worldbody></mujoco>";
}

TEST(CompileModel, RefusesAnythingOutsideItsFolder) {
  // Files that exist, so that only the check stands between model and file.
  const std::string path = testing::TempDir() + "/outside.xml";
  std::ofstream(path) << "<mujoco/>";
  const std::string models[] = {
      "<mujoco><include file='" + path + "'/></mujoco>",
      "<mujoco><include file='../outside.xml'/></mujoco>",
      "<mujoco><include file='models/../../outside.xml'/></mujoco>",
      "<mujoco><include file='/etc/passwd'/></mujoco>",
      "<mujoco><include file=\"/etc/passwd\"/></mujoco>",
      "<mujoco><include\n file \n =\n '/etc/passwd'/></mujoco>",
      "<mujoco><include file='scene.xml'/><include file='./scene.xml'/></mujoco>",
      "<mujoco><include file='&#47;etc&#47;passwd'/></mujoco>",
      "<mujoco><include file=''/></mujoco>",
      "<mujoco><include file='scene.xml\"/></mujoco>",
      "<mujoco><compiler meshdir='/usr'/></mujoco>",
      "<mujoco><compiler texturedir='..'/></mujoco>",
      WithAsset("<mesh name='m' file='/etc/passwd.stl'/>"),
      WithAsset("<mesh name='m' file='cow.stl'/>"),
      WithAsset("<texture name='t' type='2d' file='../t.png'/>"),
      WithAsset("<texture name='t' type='cube' fileright='../t.png'/>"),
      WithAsset("<hfield name='h' file='/tmp/h.png' size='1 1 1 1'/>"),
      WithAsset("<skin name='s' file='/tmp/s.skn'/>"),
      "<robot name='r'><link name='l'><visual><geometry><mesh filename='/etc/passwd.stl'/>"
      "</geometry></visual></link></robot>",
  };
  for (const std::string& model : models) {
    try {
      CompileModel("probe", model);
      ADD_FAILURE() << "accepted " << model;
    } catch (const EngineError& error) {
      const std::string message = error.what();
      EXPECT_NE(message.find("'probe' refers to"), std::string::npos) << message;
    }
  }
}

TEST(CompileModel, MayIncludeThePluginsOwnFiles) {
  const ModelPtr model = CompileModel(
      "probe",
      "<mujoco><include file='scene.xml'/><worldbody><geom size='1'/></worldbody></mujoco>");
  EXPECT_GE(mj_name2id(model.get(), mjOBJ_MATERIAL, "grid"), 0);
}

TEST(CompileModel, SaysWhatIsWrongWithAModel) {
  for (const char* model :
       {"", "<mujoco>", "not XML", "<mujoco><nonsense/></mujoco>",
        "<mujoco><include file='scene.xml'/><include file='scene.xml'/></mujoco>",
        "<mujoco><worldbody><body><joint range='0 1'/></body></worldbody></mujoco>",
        "<mujoco><worldbody><geom size='-1'/></worldbody></mujoco>"}) {
    try {
      CompileModel("probe", model);
      ADD_FAILURE() << "accepted " << model;
    } catch (const EngineError& error) {
      EXPECT_NE(std::string(error.what()).find("'probe' does not compile: "), std::string::npos)
          << error.what();
      EXPECT_GT(std::string(error.what()).size(), 30u);
    }
  }
}

TEST(CopyOfCompiled, GivesEachCallerAModelOfItsOwn) {
  const std::string text = "<mujoco><worldbody><geom name='g' size='1'/></worldbody></mujoco>";
  const ModelPtr first = CopyOfCompiled("copy probe", text);
  first->geom_size[0] = 5;
  const ModelPtr second = CopyOfCompiled("copy probe", text);
  EXPECT_EQ(second->geom_size[0], 1);
}

TEST(ModelText, KnowsItsFiles) {
  EXPECT_NE(ModelText("walker.xml").find("torso"), std::string::npos);
  EXPECT_THROW(ModelText("dog.xml"), EngineError);
}

}  // namespace
}  // namespace dreamsearch::dmc
