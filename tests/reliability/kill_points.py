#!/usr/bin/env python3
"""SIGKILL at the N-th write-class system call of a training run with checkpoints, for many N.

kill_points.py BIN_DIR [--points N] [--steps N] [--skip N] [--journal-off LIBRARY]

First the supervisor alone is killed at each of its calls, then the worker at each of its own;
whoever is left ends as it likes. After each kill no committed row may be missing, the database
must be whole, and the same command must finish the run with the result of an undisturbed one.
--points spreads that many kills evenly over all calls; 0, the default, is every call. --steps is
the length of the run: more steps, more checkpoints and calls. --skip passes over the first N
points, those of an earlier part.

With --journal-off the databases are written without a journal (the library is preloaded), and
the harness must find corruption: then it exits with 0, and with 1 if it finds none.
"""
import argparse
import os
import subprocess
import sys
import time

import scripted_run as run


def kill_supervisor(programs, folder, words, n):
    """Whether it was killed at its n-th call."""
    process = programs.start(
        folder, "runner", *words,
        before=["strace", "-qq", "-o", "/dev/null", "-e", "trace=" + run.WRITE_CLASS, "-e",
                "inject=%s:signal=SIGKILL:when=%d" % (run.WRITE_CLASS, n)])
    process.communicate(timeout=300)
    return process.returncode == -9 or process.returncode == 137


def kill_worker(programs, folder, words, n):
    process = programs.start(folder, "runner", *words)
    worker = run.worker_of(process)
    if worker is not None:
        injected = run.Injected(worker, "signal=SIGKILL:when=%d" % n)
        try:
            os.kill(worker, 18)
        except OSError:
            pass
    out, err = process.communicate(timeout=300)
    if worker is not None:
        injected.wait()
    return process.returncode == 71


def calls_of(programs, words, worker):
    """How many write-class calls one of them makes in an undisturbed run."""
    with run.Place() as folder:
        log = folder / "calls"
        trace = ["strace", "-f", "-qq", "-o", str(log), "-e", "trace=" + run.WRITE_CLASS]
        if not worker:
            trace.remove("-f")
            programs.call(folder, "runner", *words, before=trace)
            return len(log.read_text().splitlines())
        process = programs.start(folder, "runner", *words)
        pid = run.worker_of(process)
        tracer = subprocess.Popen([*trace, "-p", str(pid)], stderr=subprocess.DEVNULL)
        for _ in range(20000):
            if log.exists():
                break
            time.sleep(0.0005)
        time.sleep(0.1)
        os.kill(pid, 18)
        process.communicate()
        tracer.wait()
        return len(log.read_text().splitlines())


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin_dir")
    parser.add_argument("--points", type=int, default=0)
    parser.add_argument("--steps", type=int, default=240)
    parser.add_argument("--skip", type=int, default=0)
    parser.add_argument("--journal-off")
    options = parser.parse_args()
    why_not = run.tracing_is_allowed()
    if why_not:
        print("skipped: " + why_not)
        return run.SKIPPED
    safe = run.Programs(options.bin_dir)
    programs = run.Programs(options.bin_dir, options.journal_off)
    words = run.training(steps=options.steps)
    expected = run.undisturbed(safe, words)
    faults = run.Faults()
    killed = passed = 0
    for who, kill in (("supervisor", kill_supervisor), ("worker", kill_worker)):
        if options.journal_off and who == "supervisor":
            continue
        calls = calls_of(programs, words, who == "worker")
        share = max(1, options.points // 4 if who == "supervisor" else options.points * 3 // 4)
        step = max(1, calls // share) if options.points else 1
        print("%s: %d write-class system calls, every %d" % (who, calls, step), flush=True)
        for n in range(1, calls + 1, step):
            passed += 1
            if passed <= options.skip:
                continue
            if passed % 100 == 0:
                print("point %d: %d kills, %d faults" % (passed, killed, len(faults.found)),
                      flush=True)
            where = "%s, call %d" % (who, n)
            with run.Place() as folder:
                with run.Witness(folder / "r.db") as witness:
                    hit = kill(programs, folder, words, n)
                if not run.wait_until_nobody_works(folder):
                    faults.add(where, "a process is left 30 s after the kill")
                if not hit:
                    continue
                killed += 1
                run.check_whole(safe, folder, "r.db", witness.seen, where, faults)
                if not options.journal_off:
                    run.check_resumes(programs, folder, words, expected, where, faults)
    print("%d kills, %d faults" % (killed, len(faults.found)))
    if options.journal_off:
        print("corruption was%s found with the journal off" % ("" if faults.found else " NOT"))
        return 0 if faults.found else 1
    return faults.status() if killed else 1


if __name__ == "__main__":
    sys.exit(main())
