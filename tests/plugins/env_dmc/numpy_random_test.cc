#include "plugins/mujoco/numpy_random.h"

#include <gtest/gtest.h>

namespace dreamsearch::mujoco {
namespace {

// Values that numpy.random.RandomState(0) prints.
TEST(NumpyRandom, UniformDrawsAreNumpys) {
  NumpyRandom random(0);
  EXPECT_EQ(random.Uniform(), 0.5488135039273248);
  EXPECT_EQ(random.Uniform(), 0.7151893663724195);
  EXPECT_EQ(random.Uniform(), 0.6027633760716439);
  EXPECT_EQ(random.Uniform(), 0.5448831829968969);
}

TEST(NumpyRandom, NormalDrawsAreNumpys) {
  NumpyRandom random(0);
  EXPECT_EQ(random.Normal(), 1.764052345967664);
  EXPECT_EQ(random.Normal(), 0.4001572083672233);
  EXPECT_EQ(random.Normal(), 0.9787379841057392);
  EXPECT_EQ(random.Normal(), 2.240893199201458);
}

TEST(NumpyRandom, UniformDrawsLeaveTheKeptNormalAlone) {
  NumpyRandom straight(7);
  straight.Normal();
  const double kept = straight.Normal();
  NumpyRandom interrupted(7);
  interrupted.Normal();
  interrupted.Uniform();
  EXPECT_EQ(interrupted.Normal(), kept);
}

}  // namespace
}  // namespace dreamsearch::mujoco
