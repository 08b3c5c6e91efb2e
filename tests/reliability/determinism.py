#!/usr/bin/env python3
"""The same seed gives the same bits: tasks x planners x models, each played in several ways.

determinism.py BIN_DIR [--full] [--skip N]

Of each combination a run is made plainly, and then again: repeated in another folder, on one core
and on two, with two jobs, with decisions logged and trees recorded, interrupted and resumed, and
with seeds and planners in another order and beside other runs. The result digests must be equal.
Without --full a few combinations are played. --skip passes over the first N, those of an earlier
part.
"""
import argparse
import os
import signal
import sys
import time

import scripted_run as run

TASKS = ("cartpole_balance", "reacher_easy", "walker_walk")
PLANNERS = ("random", "dreamer", *run.SMALL_SEARCHES)
MODELS = ("dreamer", "tdmpc")
STEPS = 240


class Ways:
    """The ways of making one run. Each gives the digests of all runs of its command."""

    def __init__(self, programs, task, planner, model):
        self.programs = programs
        self.task, self.planner, self.model = task, planner, model

    def words(self, **changes):
        given = dict(env=self.task, planner=self.planner, model=self.model, steps=STEPS)
        given.update(changes)
        return run.training(**given)

    def digest(self, found):
        for name, digest in found.items():
            if name == "%s %s %s 0" % (self.task, self.planner, self.model):
                return digest
        return "no run %s in %s" % (self.planner, found)

    def play(self, before=(), **changes):
        with run.Place() as folder:
            code, out, err = self.programs.call(folder, "runner", *self.words(**changes),
                                                before=before)
            if code != 0:
                return "exit %d: %s" % (code, err.strip()[-300:])
            return self.digest(run.digests(folder / "r.db"))

    def interrupted(self):
        with run.Place() as folder:
            stops = 0
            for wait in (0.02, 0.06, 0.15, 0.3):
                process = self.programs.start(folder, "runner", *self.words())
                while process.poll() is None and not run.query(
                        folder / "r.db", "SELECT 1 FROM segment WHERE ended_utc IS NULL"):
                    time.sleep(0.002)
                time.sleep(wait)
                if process.poll() is None:
                    process.send_signal(signal.SIGTERM)
                process.communicate()
                stops += process.returncode == 75
                # A runner whose runs have ended no longer waits for a signal.
                ended = (process.returncode == -signal.SIGTERM and
                         run.value(folder / "r.db", "SELECT status FROM run") == "finished")
                if process.returncode not in (0, 75) and not ended:
                    return "exit %d after a stop" % process.returncode
            code, out, err = self.programs.call(folder, "runner", *self.words())
            if code != 0:
                return "exit %d after %d stops: %s" % (code, stops, err.strip()[-300:])
            return self.digest(run.digests(folder / "r.db"))

    def all(self):
        other = "random" if self.planner != "random" else "dreamer"
        yield "repeated", self.play
        yield "on one core", lambda: self.play(before=["taskset", "-c", "0"])
        yield "two jobs", lambda: self.play(seeds=("--seeds", 2), jobs=2)
        yield "logged", lambda: self.play(more=["--log-decisions", "--record-trees"])
        yield "interrupted", self.interrupted
        yield "other order", lambda: self.play(
            planner=other + "," + self.planner, seeds=("--seed-list", "1,0"))


def combinations(full):
    if full:
        return [(task, planner, model) for task in TASKS for planner in PLANNERS
                for model in MODELS]
    return [("cartpole_balance", "mcts_pw", "dreamer"), ("cartpole_balance", "cem", "tdmpc"),
            ("reacher_easy", "dreamer", "dreamer")]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin_dir")
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--skip", type=int, default=0)
    options = parser.parse_args()
    programs = run.Programs(options.bin_dir)
    faults = run.Faults()
    compared = 0
    for task, planner, model in combinations(options.full)[options.skip:]:
        ways = Ways(programs, task, planner, model)
        plain = ways.play()
        name = "%s %s on %s" % (task, planner, model)
        if len(plain) != 16 and len(plain) != 64:
            faults.add(name, "plain: " + plain)
            continue
        for way, play in ways.all():
            found = play()
            compared += 1
            if found != plain:
                faults.add(name, "%s: %s, expected %s" % (way, found, plain))
        print("%s: %s" % (name, plain), flush=True)
    print("%d comparisons, %d differ" % (compared, len(faults.found)))
    return faults.status() if compared else 1


if __name__ == "__main__":
    sys.exit(main())
