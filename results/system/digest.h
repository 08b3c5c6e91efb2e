// digest.h - digests of what a run did and of what is stored of it.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

namespace dreamsearch::results {

// A digest of 64-bit words in order. Its whole state is one number, so that it
// can be kept in a checkpoint. The step is the SplitMix64 finaliser (Steele, Lea,
// Flood 2014) of the state mixed with the word: for a given state it is a
// bijection of the word, so a change of one word always changes the state after it.
class RollingDigest {
 public:
  RollingDigest() = default;
  explicit RollingDigest(std::uint64_t state) : state_(state) {}

  void AddBits(std::uint64_t bits) {
    std::uint64_t x = (state_ * 0xd1342543de82ef95ull + 0x9e3779b97f4a7c15ull) ^ bits;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
    state_ = x ^ (x >> 31);
  }
  void AddReal(double value) {
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    AddBits(bits);
  }

  std::uint64_t state() const { return state_; }

 private:
  std::uint64_t state_ = 0;
};

// The digest of an episode: the bits of each decision's action, reward and value.
class EpisodeDigest {
 public:
  EpisodeDigest() = default;
  // Goes on from a checkpointed state().
  explicit EpisodeDigest(std::uint64_t state) : digest_(state) {}

  // action: `size` numbers in [-1, 1].
  void AddDecision(const double* action, std::uint64_t size, double reward, double value) {
    for (std::uint64_t i = 0; i < size; ++i) digest_.AddReal(action[i]);
    digest_.AddReal(reward);
    digest_.AddReal(value);
  }

  std::uint64_t state() const { return digest_.state(); }

 private:
  RollingDigest digest_;
};

}  // namespace dreamsearch::results
