#!/usr/bin/env python3
"""Checks `results compare` against numpy and scipy.

usage: compare_check.py RESULTS_PROGRAM DATABASE

Reads the episodes with the sqlite3 module, works out every statistic anew and
compares: point values to 1e-12; intervals, whose draws are others, to the error
that two bootstraps of so many repetitions may have. Exits 77 without numpy or
scipy, which CTest reports as skipped.
"""
import json
import sqlite3
import subprocess
import sys
from collections import defaultdict

try:
    import numpy as np
    from scipy.stats import mannwhitneyu, trim_mean
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

program, database = sys.argv[1:3]
seed_of_check = 12345
rng = np.random.default_rng(seed_of_check)
failures = 0


def check(what, found, expected, tolerance):
    global failures
    if abs(found - expected) > tolerance:
        failures += 1
        print(f"{what}: found {found!r}, expected {expected!r} within {tolerance}"
              f" (seed {seed_of_check})")


def check_interval(what, found, values, found_repetitions=None):
    """The ends lie where the check's own repetitions have these quantiles: a share of
    R draws is known to sqrt(q (1 - q) / R), and four of these are allowed. What was found with
    no more repetitions than ours is not better known itself."""
    global failures
    for end, q in (("lo", 0.025), ("hi", 0.975)):
        draws = 1 / len(values) + (1 / found_repetitions if found_repetitions else 0)
        error = 4 * np.sqrt(q * (1 - q) * draws)
        low, high = np.quantile(values, [max(q - error, 0), min(q + error, 1)])
        if not low - 1e-12 <= found[end] <= high + 1e-12:
            failures += 1
            print(f"{what} {end}: found {found[end]}, expected {low} to {high}"
                  f" (seed {seed_of_check})")


def scores_of(db):
    rows = db.execute("""
        SELECT r.planner, t.name, r.run_id, e.phase, avg((e.episode_return - t.return_low)
               / (t.return_high - t.return_low))
        FROM run r JOIN task t USING (task_id) JOIN episode e USING (run_id)
        WHERE e.phase > 0 AND e.env_step > 0.9 * r.env_steps_target AND r.parent_run_id IS NULL
        GROUP BY r.run_id, e.phase ORDER BY r.seed""").fetchall()
    has_search = {run for _, _, run, phase, _ in rows if phase == 1}
    scores = defaultdict(dict)
    for planner, task, run, phase, score in rows:
        if phase == (1 if run in has_search else 2):
            scores[planner].setdefault(task, []).append(score)
    return scores


def statistics(matrix):
    """matrix: a list of arrays, one a task."""
    flat = np.sort(np.concatenate(matrix))
    means = np.array([runs.mean() for runs in matrix])
    return {
        "mean": means.mean(),
        "median": np.median(means),
        "interquartile mean": trim_mean(flat, 0.25),
        "optimality gap": np.mean(1 - np.minimum(flat, 1)),
    }


def improvement(x, y):
    return np.mean([mannwhitneyu(a, b, method="asymptotic").statistic / (len(a) * len(b))
                    for a, b in zip(x, y)])


def improvement_by_pairs(x, y):
    return np.mean([np.mean((a[:, None] > b) + 0.5 * (a[:, None] == b)) for a, b in zip(x, y)])


def resample(matrix):
    return [rng.choice(runs, len(runs)) for runs in matrix]


found = json.loads(subprocess.run(
    [program, "compare", "--db", database, "--format", "json", "--bootstrap-seed", "5"],
    check=True, capture_output=True).stdout)
again = json.loads(subprocess.run(
    [program, "compare", "--db", database, "--format", "json", "--bootstrap-seed", "5"],
    check=True, capture_output=True).stdout)
if found != again:
    failures += 1
    print("the same --bootstrap-seed gave other figures")

scores = scores_of(sqlite3.connect(f"file:{database}?mode=ro", uri=True))
matrices = {planner: [np.array(by_task[task]) for task in found["tasks"]]
            for planner, by_task in scores.items()}
repetitions = 2000
for item in found["planners"]:
    matrix = matrices[item["planner"]]
    for task, runs in zip(found["tasks"], matrix):
        for mine, theirs in zip(item["scores"][task], runs):
            check(f"score on {task}", mine, theirs, 1e-12)
    draws = [statistics(resample(matrix)) for _ in range(repetitions)]
    for name, value in statistics(matrix).items():
        check(f"{item['planner']} {name}", item[name]["value"], value, 1e-12)
        check_interval(f"{item['planner']} {name}", item[name],
                       np.array([draw[name] for draw in draws]))
    flat = np.concatenate(matrix)
    for tau, estimate in zip(found["taus"], item["profile"]):
        check(f"{item['planner']} profile at {tau}", estimate["value"], np.mean(flat > tau), 1e-12)

for item in found["improvement"]:
    x, y = matrices[item["x"]], matrices[item["y"]]
    check(f"P({item['x']} > {item['y']})", item["value"], improvement(x, y), 1e-12)
    check_interval(f"P({item['x']} > {item['y']})", item, np.array(
        [improvement_by_pairs(resample(x), resample(y)) for _ in range(repetitions)]))

def spread(matrix):
    return np.mean([runs.std(ddof=1) for runs in matrix])


def mean(matrix):
    return np.mean([runs.mean() for runs in matrix])


def draws_of(function, matrix):
    draws = np.array([function(resample(matrix)) for _ in range(repetitions)])
    return draws * (spread(matrix) / draws.mean()) if function is spread else draws


for item in found["planners"]:
    matrix = matrices[item["planner"]]
    check(f"{item['planner']} spread", item["spread"]["value"], spread(matrix), 1e-12)
    check_interval(f"{item['planner']} spread", item["spread"], draws_of(spread, matrix),
                   found["profile_repetitions"])
for item in found["contrasts"]:
    x, y = matrices[item["x"]], matrices[item["y"]]
    for name, function in (("difference", mean), ("spread_difference", spread)):
        what = f"{name} of {item['x']} and {item['y']}"
        check(what, item[name]["value"], function(x) - function(y), 1e-12)
        check_interval(what, item[name], draws_of(function, x) - draws_of(function, y),
                       found["profile_repetitions"])
    low, high = item["difference"]["lo"], item["difference"]["hi"]
    verdict = ("they match" if low >= -0.05 and high <= 0.05 else "X is better" if low > 0
               else "X is worse" if high < 0 else "cannot tell")
    if verdict != item["verdict"]:
        failures += 1
        print(f"{item['x']} and {item['y']}: found {item['verdict']!r}, expected {verdict!r}")

print(f"{failures} differences over {len(found['tasks'])} tasks and"
      f" {len(found['planners'])} planners")
sys.exit(1 if failures else 0)
