#!/usr/bin/env python3
"""Kills and resumes one training run again and again: its result is that of an undisturbed one.

kill_cycles.py BIN_DIR [--cycles N] [--seed N]

Each cycle gives the same command, waits until the run works and for a random moment more, and
kills its worker, its supervisor, or both. At the end the run is finished undisturbed. Prints how
long it took from a kill until the run worked again. The moments are shares of what an undisturbed
run takes here, so that a fast machine is not done with the run before the last cycle.
"""
import argparse
import os
import random
import sys
import time

import scripted_run as run


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin_dir")
    parser.add_argument("--cycles", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    programs = run.Programs(options.bin_dir)
    words = run.training(steps=max(1000, 400 * options.cycles))
    begin = time.time()
    expected = run.undisturbed(programs, words)
    longest_wait = (time.time() - begin) / options.cycles
    faults = run.Faults()
    draw = random.Random(options.seed)
    waits, rolled_back, finished_early = [], 0, False
    with run.Place() as folder:
        db = folder / "r.db"
        for cycle in range(options.cycles):
            begin = time.time()
            process = programs.start(folder, "runner", *words)
            segment = -1
            while process.poll() is None:
                rows = run.query(db, "SELECT max(segment), pid FROM segment WHERE ended_utc IS NULL")
                if rows and rows[0][0] is not None and rows[0][0] >= cycle:
                    segment, worker = rows[0]
                    break
                time.sleep(0.002)
            if segment < 0:
                finished_early = process.wait() == 0
                break
            waits.append(time.time() - begin)
            time.sleep(draw.uniform(0, longest_wait))
            victims = {0: [worker], 1: [process.pid], 2: [process.pid, worker]}[cycle % 3]
            for pid in victims:
                try:
                    os.kill(pid, 9)
                except OSError:
                    pass
            process.communicate(timeout=120)
            run.wait_until_nobody_works(folder)
            if cycle % 10 == 0:
                run.check_whole(programs, folder, "r.db", 0, "cycle %d" % cycle, faults)
        if finished_early and len(waits) < options.cycles:
            print("the run finished after %d cycles" % len(waits))
        run.check_resumes(programs, folder, words, expected, "at the end", faults)
        segments = run.value(db, "SELECT count(*) FROM segment")
        rolled_back = run.value(db, "SELECT sum(rows_rolled_back) FROM segment")
    waits.sort()
    print("%d cycles, %d segments, %d rows remade, to work again after %.2f s (median), %.2f s at "
          "most; %d faults" % (len(waits), segments, rolled_back or 0, waits[len(waits) // 2],
                               waits[-1], len(faults.found)))
    return faults.status() if len(waits) >= min(options.cycles, 3) else 1


if __name__ == "__main__":
    sys.exit(main())
