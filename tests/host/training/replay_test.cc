#include "host/training/replay.h"

#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <string>
#include <vector>

#include "results/system/error.h"

namespace dreamsearch {
namespace {

// Observation (episode, row), action (row), reward row: every number tells where
// it came from.
void AddEpisode(Replay* replay, int episode, int decisions, bool ends = false) {
  std::vector<double> observation = {double(episode), 0};
  replay->BeginEpisode({observation.data(), 2});
  for (int i = 1; i <= decisions; ++i) {
    observation[1] = i;
    const double action = i;
    replay->Add({&action, 1}, i, ends && i == decisions ? 0 : 1, {observation.data(), 2});
  }
  replay->EndEpisode();
}

std::string Saved(const Replay& replay) {
  std::string bytes;
  StateWriter writer([&](std::string_view piece) { bytes += piece; });
  replay.Save(&writer);
  writer.Flush();
  return bytes;
}

void Load(const std::string& bytes, Replay* replay) {
  std::size_t position = 0;
  StateReader reader(
      [&](void* data, std::uint64_t size) {
        std::memcpy(data, bytes.data() + position, size);
        position += size;
      },
      bytes.size(), "here", "Start over");
  replay->Load(&reader);
  reader.Finish();
}

TEST(Replay, SequencesLieInsideOneEpisodeAndKeepTheirOrder) {
  Replay replay(2, 1, 1000);
  AddEpisode(&replay, 0, 20);
  AddEpisode(&replay, 1, 7);
  AddEpisode(&replay, 2, 30);
  std::set<float> episodes;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const SequenceBatch batch = replay.Sample(8, 8, seed);
    ASSERT_EQ(batch.observations.rows, 64u);
    for (std::uint64_t b = 0; b < 8; ++b) {
      const float episode = batch.observations(b * 8, 0);
      episodes.insert(episode);
      for (std::uint64_t t = 0; t < 8; ++t) {
        const std::uint64_t row = b * 8 + t;
        EXPECT_EQ(batch.observations(row, 0), episode);
        const float i = batch.observations(row, 1);
        EXPECT_EQ(i, batch.observations(b * 8, 1) + static_cast<float>(t));
        // The action and reward that led to this observation.
        EXPECT_EQ(batch.actions(row, 0), i);
        EXPECT_EQ(batch.rewards[row], i);
        EXPECT_EQ(batch.is_first[row], i == 0 ? 1 : 0);
      }
    }
  }
  EXPECT_EQ(episodes, (std::set<float>{0, 1, 2}));
}

// Rows in the order they were lived, whatever sequence they came in.
std::vector<int> DrawnRows(Replay* replay, std::uint64_t length, int batches) {
  std::vector<int> drawn;
  for (int seed = 0; seed < batches; ++seed) {
    const SequenceBatch batch = replay->Sample(4, length, static_cast<std::uint64_t>(seed));
    for (std::uint64_t row = 0; row < batch.observations.rows; ++row) {
      drawn.push_back(static_cast<int>(batch.observations(row, 0)) * 100 +
                      static_cast<int>(batch.observations(row, 1)));
    }
  }
  return drawn;
}

TEST(Replay, SequencesRunOverTheEndsOfShortEpisodes) {
  Replay replay(2, 1, 1000);
  for (int episode = 0; episode < 6; ++episode) AddEpisode(&replay, episode, 4 + episode % 2);
  const SequenceBatch batch = replay.Sample(50, 12, 3);
  for (std::uint64_t row = 1; row < batch.observations.rows; ++row) {
    if (row % 12 == 0) continue;
    const float episode = batch.observations(row, 0), before = batch.observations(row - 1, 0);
    EXPECT_EQ(batch.is_first[row], episode == before ? 0 : 1);
    EXPECT_EQ(episode, before + batch.is_first[row]);
    EXPECT_EQ(batch.observations(row, 1),
              batch.is_first[row] != 0 ? 0 : batch.observations(row - 1, 1) + 1);
  }
}

TEST(Replay, EveryRowIsDrawnWhereEpisodesAreOfAllLengths) {
  Replay replay(2, 1, 1000);
  std::set<int> lived;
  const int decisions[] = {1, 40, 3, 12, 2, 30, 5};
  for (int episode = 0; episode < 7; ++episode) {
    AddEpisode(&replay, episode, decisions[episode]);
    for (int i = 0; i <= decisions[episode]; ++i) lived.insert(100 * episode + i);
  }
  const std::vector<int> drawn = DrawnRows(&replay, 10, 400);
  EXPECT_EQ(std::set<int>(drawn.begin(), drawn.end()), lived);
}

TEST(Replay, EpisodesAreDrawnInProportionToTheirRows) {
  Replay replay(2, 1, 1000);
  AddEpisode(&replay, 0, 99);  // 100 rows
  for (int episode = 1; episode <= 10; ++episode) AddEpisode(&replay, episode, 9);
  double of_long = 0;
  const std::vector<int> drawn = DrawnRows(&replay, 5, 1000);
  for (const int row : drawn) of_long += row < 100 ? 1 : 0;
  EXPECT_NEAR(of_long / static_cast<double>(drawn.size()), 0.5, 0.03);
}

TEST(Replay, DrawsEveryStartOfAnEpisodeTheLastOneIncluded) {
  Replay replay(2, 1, 100);
  AddEpisode(&replay, 0, 5);  // 6 rows: starts 0, 1, 2 for length 4
  std::set<float> starts;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    starts.insert(replay.Sample(1, 4, seed).observations(0, 1));
  }
  EXPECT_EQ(starts, (std::set<float>{0, 1, 2}));
}

TEST(Replay, UnfinishedEpisodesAreNotDrawn) {
  Replay replay(2, 1, 100);
  AddEpisode(&replay, 0, 10);
  const double observation[2] = {1, 0}, action = 0;
  replay.BeginEpisode({observation, 2});
  for (int i = 0; i < 20; ++i) replay.Add({&action, 1}, 0, 1, {observation, 2});
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    EXPECT_EQ(replay.Sample(1, 5, seed).observations(0, 0), 0);
  }
}

TEST(Replay, EqualSeedsDrawEqualBatches) {
  Replay replay(2, 1, 100);
  AddEpisode(&replay, 0, 40);
  const SequenceBatch batch = replay.Sample(4, 6, 11);
  const std::vector<float> first(batch.rewards.begin(), batch.rewards.end());
  replay.Sample(4, 6, 12);
  const SequenceBatch again = replay.Sample(4, 6, 11);
  EXPECT_EQ(first, std::vector<float>(again.rewards.begin(), again.rewards.end()));
}

TEST(Replay, OldestEpisodesMakeRoom) {
  Replay replay(2, 1, 100);
  for (int episode = 0; episode < 40; ++episode) AddEpisode(&replay, episode, 10);
  EXPECT_LE(replay.rows(), 100u);
  std::set<float> episodes;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    episodes.insert(replay.Sample(1, 5, seed).observations(0, 0));
  }
  EXPECT_EQ(*episodes.rbegin(), 39);
  EXPECT_GE(*episodes.begin(), 30);
}

TEST(Replay, SaveAndLoadKeepsEveryRow) {
  Replay replay(2, 1, 100), copy(2, 1, 100);
  AddEpisode(&replay, 0, 9);
  AddEpisode(&replay, 1, 12);
  const double observation[2] = {2, 0};
  replay.BeginEpisode({observation, 2});
  Load(Saved(replay), &copy);
  EXPECT_EQ(copy.rows(), replay.rows());
  EXPECT_EQ(copy.finished_rows(), replay.finished_rows());
  EXPECT_EQ(Saved(copy), Saved(replay));
  // The episode under way goes on in the copy.
  const double action = 0;
  copy.Add({&action, 1}, 0, 1, {observation, 2});
  copy.EndEpisode();
}

TEST(Replay, SaysWhatDoesNotFit) {
  Replay replay(2, 1, 100), other(3, 1, 100);
  AddEpisode(&replay, 0, 9);
  EXPECT_THROW(Load(Saved(replay), &other), Failure);
  EXPECT_THROW(Load(Saved(replay).substr(0, 40), &replay), Failure);
  try {
    replay.Sample(1, 50, 0);
    FAIL();
  } catch (const Failure& error) {
    EXPECT_NE(std::string(error.what()).find("at most the 10 observations"), std::string::npos)
        << error.what();
  }
}

// An episode whose even rows were searched: row i found the actions +-i / 100 and the value i.
void AddSearchedEpisode(Replay* replay, int episode, int decisions) {
  std::vector<double> observation = {double(episode), 0};
  replay->BeginEpisode({observation.data(), 2});
  for (int i = 0; i < decisions; ++i) {
    const std::vector<double> actions = {i / 100.0, -i / 100.0}, weights = {0.75, 0.25};
    if (i % 2 == 0) replay->SetSearch({{actions.data(), 2, 1}, {weights.data(), 2}, double(i)});
    observation[1] = i + 1;
    const double action = i + 1;
    replay->Add({&action, 1}, i + 1, 1, {observation.data(), 2});
  }
  replay->EndEpisode();
}

void ExpectSearches(const SequenceBatch& batch, int last) {
  ASSERT_EQ(batch.search_candidates, 2u);
  ASSERT_EQ(batch.search_actions.rows, 2 * batch.observations.rows);
  for (std::uint64_t row = 0; row < batch.observations.rows; ++row) {
    const int i = static_cast<int>(batch.observations(row, 1));
    const bool searched = i % 2 == 0 && i < last;
    EXPECT_EQ(batch.search_weights[2 * row], searched ? 0.75f : 0.0f);
    EXPECT_EQ(batch.search_weights[2 * row + 1], searched ? 0.25f : 0.0f);
    EXPECT_EQ(batch.search_values[row], searched ? static_cast<float>(i) : 0.0f);
    EXPECT_EQ(batch.search_actions(2 * row, 0), searched ? static_cast<float>(i / 100.0) : 0.0f);
    EXPECT_EQ(batch.search_actions(2 * row + 1, 0),
              searched ? static_cast<float>(-i / 100.0) : 0.0f);
  }
}

// What DecisionOf and Sample rely on; a file may hold anything that its checksums fit.
TEST(Replay, RowsThatContradictTheEpisodesAreRefused) {
  Replay replay(2, 1, 1000);
  AddEpisode(&replay, 0, 5);
  AddEpisode(&replay, 1, 5);
  const std::string saved = Saved(replay);
  const auto expect_refused = [&](const std::string& field, std::size_t entry, char byte) {
    std::string changed = saved;
    const std::size_t at = changed.find(field) + field.size() + 1 + sizeof(std::uint64_t) + entry;
    ASSERT_NE(changed[at], byte);
    changed[at] = byte;
    Replay other(2, 1, 1000);
    try {
      Load(changed, &other);
      ADD_FAILURE() << field << " " << entry;
    } catch (const Failure& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadInput);
    }
  };
  expect_refused("is_first", 0, 0);
  expect_refused("is_first", 3, 1);
  expect_refused("is_first", 6, 2);
  expect_refused("episode_rows", 0, 0);
  expect_refused("episode_finished", 0, 0);  // only the last may go on
  expect_refused("episode_finished", 8, 2);
}

TEST(ReplaySearches, StandBesideTheObservationThatTheyBeganFrom) {
  Replay replay(2, 1, 100, 2);
  for (int episode = 0; episode < 9; ++episode) AddSearchedEpisode(&replay, episode, 20);
  ASSERT_LT(replay.rows(), 9 * 21u) << "nothing had to make room";
  for (std::uint64_t seed = 0; seed < 20; ++seed) ExpectSearches(replay.Sample(4, 6, seed), 20);
}

TEST(ReplaySearches, ComeBackFromASave) {
  Replay replay(2, 1, 100, 2);
  AddSearchedEpisode(&replay, 0, 20);
  AddSearchedEpisode(&replay, 1, 30);
  Replay loaded(2, 1, 100, 2);
  Load(Saved(replay), &loaded);
  EXPECT_EQ(Saved(loaded), Saved(replay));
  ExpectSearches(loaded.Sample(2, 20, 1), 31);
}

TEST(ReplaySearches, MadeAnewStandInTheBatchAndInEveryLaterOne) {
  Replay replay(2, 1, 100, 2);
  AddSearchedEpisode(&replay, 0, 20);
  AddSearchedEpisode(&replay, 1, 20);
  const SequenceBatch batch = replay.Sample(3, 5, 7);
  const std::uint64_t row = 2 * 5 + 3;
  EXPECT_EQ(replay.DecisionOf(row), static_cast<std::uint64_t>(batch.observations(row, 1)));
  const std::vector<double> actions = {0.5, 0.25}, weights = {1, 0};
  replay.RenewSearch(row, {{actions.data(), 2, 1}, {weights.data(), 2}, -3});
  for (const SequenceBatch& seen : {batch, replay.Sample(3, 5, 7)}) {
    EXPECT_EQ(seen.search_actions(2 * row, 0), 0.5f);
    EXPECT_EQ(seen.search_actions(2 * row + 1, 0), 0.25f);
    EXPECT_EQ(seen.search_weights[2 * row], 1.0f);
    EXPECT_EQ(seen.search_weights[2 * row + 1], 0.0f);
    EXPECT_EQ(seen.search_values[row], -3.0f);
  }
}

TEST(ReplaySearches, OfARunThatKeepsNoneAreNeitherInABatchNorInASave) {
  Replay replay(2, 1, 100);
  AddEpisode(&replay, 0, 20);
  const SequenceBatch batch = replay.Sample(2, 5, 1);
  EXPECT_EQ(batch.search_candidates, 0u);
  EXPECT_EQ(batch.search_weights.size, 0u);
  EXPECT_EQ(Saved(replay).find("search"), std::string::npos);
}

}  // namespace
}  // namespace dreamsearch
