// schema.h - the tables and views of the results database. Their names are a
// public contract: people write SQL against them. README.md explains them.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace dreamsearch::results {

inline constexpr std::int64_t kApplicationId = 0x44524d53;  // "DRMS"

// Width of a bin of curve_bin, in environment steps. Bin k covers
// ((k - 1) kBinSteps, k kBinSteps].
inline constexpr std::int64_t kBinSteps = 10000;

// What the wall time of a run is spent on: the values of time_use.activity.
inline constexpr std::array kActivities = {"environment", "planning",  "learning",
                                           "evaluation",  "recording", "other"};

// Migrations()[i] brings the tables and triggers of user_version i to those of i + 1;
// a new file runs all of them. Forward only: a released migration is never edited.
// The views are of the newest schema alone: dropped before the migrations and made
// after them. A change of a view is therefore a migration that does nothing.
const std::vector<std::string>& Migrations();
const std::string& DropViews();
const std::string& CreateViews();

// Some rows have a SHA-256 of what no digest of a run covers, made by the function sha256() of a
// Connection. Fills those that are empty after the migrations of an older schema.
const std::string& FillDigests();
// The expressions for those of a study and of a published point.
inline constexpr char kStudySha256[] =
    "sha256(name || char(10) || description || char(10) || created_utc)";
inline constexpr char kPublishedSha256[] =
    "sha256(quote(source) || quote(method) || quote(obs) || quote(task) || ' ' || env_steps || ' '"
    " || quote(seed) || ' ' || quote(episode_return) || ' ' || quote(n_seeds) || ' ' ||"
    " quote(seed_sd))";

// The newest schema, that is Migrations().size().
std::int64_t SchemaVersion();

}  // namespace dreamsearch::results
