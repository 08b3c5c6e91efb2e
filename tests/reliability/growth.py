#!/usr/bin/env python3
"""Memory and descriptors of a worker over a long run, and how soon a stop is obeyed.

growth.py BIN_DIR [--seconds S]

Samples the worker of a run. After the first third memory may grow by no more than a hundredth (in
less than a minute also by SQLite's cache, which is not yet full then), and by no descriptor. Then the
run is asked to stop (SIGTERM): exit 75 with a checkpoint within five seconds.
"""
import argparse
import os
import pathlib
import sys
import time

import scripted_run as run

CACHE_BYTES = 2000 * 1024  # of the worker's connection, RunWriter


def resident(pid):
    pages = int(pathlib.Path("/proc/%d/statm" % pid).read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin_dir")
    parser.add_argument("--seconds", type=int, default=600)
    options = parser.parse_args()
    programs = run.Programs(options.bin_dir)
    faults = run.Faults()
    with run.Place() as folder:
        words = run.training(steps=400000000, more=["--set", "run.replay_capacity=5000"])
        words = [word.replace("run.checkpoint_every=40", "run.checkpoint_every=20000")
                 for word in words]
        process = programs.start(folder, "runner", *words)
        worker = None
        while process.poll() is None and worker is None:
            worker = run.value(folder / "r.db", "SELECT pid FROM segment WHERE segment = 0")
            time.sleep(0.05)
        begin = time.time()
        samples = []
        while process.poll() is None and time.time() - begin < options.seconds:
            samples.append((resident(worker), len(os.listdir("/proc/%d/fd" % worker))))
            time.sleep(0.5)
        steps = run.value(folder / "r.db", "SELECT env_steps_done FROM run")
        warm = samples[len(samples) // 3:]
        grown = warm[-1][0] - warm[0][0]
        filling = CACHE_BYTES if options.seconds < 60 else 0
        if grown > warm[0][0] // 100 + filling:
            faults.add("memory", "grew by %d bytes from %d" % (grown, warm[0][0]))
        if warm[-1][1] > warm[0][1] + 1:  # a checkpoint may be open just now
            faults.add("descriptors", "%d, then %d" % (warm[0][1], warm[-1][1]))
        asked = time.time()
        process.terminate()
        out, err = process.communicate(timeout=120)
        took = time.time() - asked
        if process.returncode != 75 or not list(folder.glob("r.db.files/*/checkpoint-*.ckpt")):
            faults.add("SIGTERM", "exit %d: %s" % (process.returncode, err[-300:]))
        if took > 5:
            faults.add("SIGTERM", "took %.1f s" % took)
        print("%d steps in %d s: %.1f MB after a third of them, %.1f MB at the end (%+.2f %%), %d "
              "descriptors; SIGTERM to exit 75 in %.2f s; %d faults" %
              (steps, options.seconds, warm[0][0] / 1e6, warm[-1][0] / 1e6,
               100 * grown / warm[0][0], warm[-1][1], took, len(faults.found)))
    return faults.status()


if __name__ == "__main__":
    sys.exit(main())
