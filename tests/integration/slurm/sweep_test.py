#!/usr/bin/env python3
"""Twelve runs on a real Slurm, one requeued, one killed and one that fails; and four more, one of
which comes to its time limit before the node is lost.

sweep_test.py BIN FAULTY starts a cluster of this machine, submits with BIN/runner, with the test
plugins of the folder FAULTY, and compares with the same runs done here. Ends with 77 where Slurm is
not installed.

sweep_test.py BIN FAULTY --measure N times N runs instead: the submission, the sweep, and what a task
adds to its run, which is the time of a task's script, less the share of a run in the same runs here
by one command. Ends with 1 if the submission takes 5 s, or if a task adds 0.2 s of processor time.
Wall time stands beside it: on a busy machine it tells of the others.
"""
import os
import pathlib
import re
import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True
import cluster

PATIENCE = 600
MOST_SUBMISSION, MOST_ADDED = 5, 0.2  # seconds
SETTINGS = ["run.prefill_steps=1000", "run.pretrain_updates=4", "run.train_every=250",
            "run.batch_size=4", "run.sequence_length=8", "run.eval_episodes=1",
            "run.eval_every=2000", "run.checkpoint_every=1000", "model.hidden=16",
            "model.deterministic=16", "model.stochastic=4", "model.imagination_starts=8",
            "model.horizon=3"]


class Sweep:
    def __init__(self, binaries, faulty, folder, name="the sweep 100%j"):
        self.binaries = pathlib.Path(binaries).resolve()
        self.faulty = str(pathlib.Path(faulty).resolve())
        # A space, and what Slurm would expand in a file name.
        self.folder = folder / name
        self.place = folder

    def flags(self, planner, steps, more=()):
        words = ["--env", "cartpole_balance", "--planner", planner, "--steps", str(steps),
                 "--plugin-path", self.faulty]
        for setting in SETTINGS:
            words += ["--set", setting]
        return words + list(more)

    def call(self, program, *words, expect=0):
        done = subprocess.run([self.binaries / program, *words], cwd=self.place,
                              capture_output=True, text=True)
        assert done.returncode in (expect if isinstance(expect, tuple) else (expect,)), (
            f"{program} {words} ended with {done.returncode}:\n{done.stdout}\n{done.stderr}")
        return done.stdout, done.stderr

    def submit(self, planner, steps, *more, expect=0):
        out, err = self.call("runner", "submit", "--folder", str(self.folder),
                             *self.flags(planner, steps, more), expect=expect)
        print(err, end="")
        return out.split()

    def databases(self):
        return sorted((self.folder / "runs").glob("*.db"))

    def query(self, database, sql):
        try:
            with sqlite3.connect(f"file:{database}?mode=ro", uri=True, timeout=10) as connection:
                return connection.execute(sql).fetchall()
        except sqlite3.OperationalError:
            return []  # not made yet

    def log(self):
        return "".join(f"--- {path}\n{path.read_text(errors='replace')}"
                       for path in sorted((self.folder / "logs").glob("*")))


def until(what, ready, seconds=PATIENCE):
    end = time.monotonic() + seconds
    while True:
        found = ready()
        if found:
            return found
        assert time.monotonic() < end, f"after {seconds} s still not: {what}"
        time.sleep(0.05)


def queue():
    done = subprocess.run(["squeue", "--noheader", "--array", "--format=%F_%K %T"],
                          capture_output=True, text=True)
    return done.stdout.split("\n")[:-1]


def active(sweep):
    """Runs that have made a checkpoint, as (job, pid, database)."""
    found = []
    for database in sweep.databases():
        for row in sweep.query(database, "SELECT s.slurm_job, s.pid FROM run r JOIN segment s USING"
                               " (run_id) WHERE r.status = 'running' AND s.ended_utc IS NULL AND EXISTS"
                               " (SELECT 1 FROM artifact a WHERE a.run_id = r.run_id AND a.kind ="
                               " 'checkpoint')"):
            found.append((*row, database))
    return found


def digests(database):
    return dict(((task, planner, seed), digest) for task, planner, seed, digest in
                sqlite3.connect(database).execute(
                    "SELECT t.name, planner, seed, result_digest FROM run JOIN task t USING"
                    " (task_id) WHERE status = 'finished'"))


def test(sweep):
    good, steps = 11, 12000
    jobs = sweep.submit("random", steps, "--seeds", str(good))
    assert len(jobs) == 2, jobs
    # More of the same sweep, which waits for the first.
    more = sweep.submit("throwing_planner", steps)
    assert len(more) == 2, more

    requeued, _, _ = until("a run to requeue", lambda: active(sweep))[0]
    subprocess.run(["scontrol", "requeue", requeued], check=True)
    print(f"requeued {requeued}")
    killed, pid, killed_database = until("another run to kill", lambda: [
        each for each in active(sweep) if each[0] != requeued])[0]
    os.kill(pid, signal.SIGKILL)
    print(f"killed the worker {pid} of {killed}")

    until("the merge job's end", lambda: not queue())
    status, _ = sweep.call("runner", "status", "--folder", str(sweep.folder))
    print(status)
    log = (sweep.folder / "logs" / f"merge_{more[1]}.log").read_text()
    assert "cartpole_balance throwing_planner seed 0  failed" in log, log
    assert f"  missing  " in log and log.count(" seed ") == 2, log
    assert (sweep.folder / "report.html").stat().st_size > 10000

    # The failed one is left, the killed one goes on from its checkpoint.
    again = sweep.submit("random", steps, "--seeds", str(good))
    assert len(again) == 2, again
    assert sweep.submit("throwing_planner", steps, expect=71) == []
    until("the second merge job's end", lambda: not queue())
    assert sweep.submit("random", steps, "--seeds", str(good)) == []

    segments = sweep.query(killed_database, "SELECT segment, from_env_step, slurm_job, slurm_node,"
                           " slurm_restarts FROM segment ORDER BY segment")
    assert segments[0][2] == killed and segments[1][2] == f"{again[0]}_0", segments
    assert segments[1][1] >= 1000, segments
    everything = sweep.folder / "all.db"
    restarts = sweep.query(everything, "SELECT from_env_step, slurm_restarts, slurm_node FROM segment"
                           f" WHERE slurm_job = '{requeued}' ORDER BY segment")
    assert [row[1] for row in restarts] == [0, 1], restarts
    assert restarts[1][0] >= 1000 and restarts[1][2], restarts

    sweep.call("runner", "--db", "local.db", *sweep.flags("random", steps, ["--seeds", str(good)]))
    sweep.call("runner", "--db", "local.db", *sweep.flags("throwing_planner", steps), expect=71)
    expected, found = digests(sweep.place / "local.db"), digests(everything)
    assert len(expected) == good and found == expected, (expected, found)
    runs = sweep.query(everything, "SELECT planner, count(*), count(DISTINCT seed) FROM run"
                       " GROUP BY planner ORDER BY planner")
    assert runs == [("random", good, good), ("throwing_planner", 1, 1)], runs
    sweep.call("results", "verify", "--db", str(everything))
    print(f"{good} runs, each once, with the digests of a local sweep")


def parents(pid):
    """From the worker up to Slurm's own process: worker, runner, batch script, step."""
    found = [pid]
    while len(found) < 4:
        status = pathlib.Path(f"/proc/{found[-1]}/status").read_text()
        found.append(int(re.search(r"^PPid:\s*(\d+)", status, re.M)[1]))
    return found


def test_limits(sweep, slurm):
    """A time limit, and a node that is lost; all with one instruction set."""
    count, steps, instructions = 4, 12000, "x86-64"
    flags = ["--seeds", str(count), "--instruction-set", instructions]
    assert len(sweep.submit("random", steps, *flags)) == 2

    # A stopped process lasts until it is asked to end, which lets it go on.
    limited, pid, database = until("a run to limit", lambda: active(sweep))[0]
    os.kill(pid, signal.SIGSTOP)
    subprocess.run(["scontrol", "update", f"jobid={limited}", "timelimit=1"], check=True)
    ends = "SELECT end_reason FROM segment WHERE segment = 0 AND ended_utc IS NOT NULL"
    until("the warning before the time limit", lambda: sweep.query(database, ends))
    subprocess.run(["scontrol", "update", f"jobid={limited}", "timelimit=60"], check=True)
    print(f"{limited} came to its time limit")

    lost, pid, lost_database = until("a run on the node that is lost",
                                     lambda: [each for each in active(sweep)])[0]
    family = parents(pid)
    names = [pathlib.Path(f"/proc/{each}/comm").read_text().strip() for each in family]
    assert names[-1].startswith("slurmstepd"), names
    slurm.lose_node(reversed(family))
    print(f"lost the node of {lost}")
    until("the merge job's end", lambda: not queue())

    segments = sweep.query(database, "SELECT end_reason, from_env_step, slurm_restarts FROM segment"
                           " ORDER BY segment")
    assert segments[0][0] == "interrupted" and segments[1][1] >= 1000, segments
    segments = sweep.query(lost_database, "SELECT from_env_step, slurm_restarts, slurm_job FROM"
                           " segment ORDER BY segment")
    assert segments[-1][0] >= 1000 and segments[-1][1] >= 1 and segments[-1][2] == lost, segments
    everything = sweep.folder / "all.db"
    sets = sweep.query(everything, "SELECT DISTINCT instruction_set FROM segment")
    assert sets == [(instructions,)], sets
    os.environ["DREAMSEARCH_INSTRUCTION_SET"] = instructions
    sweep.call("runner", "--db", "limits.db", *sweep.flags("random", steps, flags[:2]))
    del os.environ["DREAMSEARCH_INSTRUCTION_SET"]
    expected, found = digests(sweep.place / "limits.db"), digests(everything)
    assert len(expected) == count and found == expected, (expected, found)
    print(f"{count} runs, each once, with the digests of a local sweep on {instructions}")


def timed(work, times):
    """Wall and processor seconds each."""
    def processor():
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime
    begun, processor_begun = time.monotonic(), processor()
    work()
    return (time.monotonic() - begun) / times, (processor() - processor_begun) / times


def measure(sweep, count):
    flags = sweep.flags("random", 500, ["--seeds", str(count)])
    begun = time.monotonic()
    sweep.call("runner", "submit", "--folder", str(sweep.folder), *flags)
    submission = time.monotonic() - begun
    print(f"submission of {count} runs: {submission:.2f} s")
    until("the merge job's end", lambda: not queue(), 3600)
    print(f"all done: {time.monotonic() - begun:.1f} s")
    finished = len(digests(sweep.folder / "all.db"))
    assert finished == count, f"{finished} of {count} runs are finished"
    begun = time.monotonic()
    sweep.call("runner", "submit", "--folder", str(sweep.folder), *flags)
    print(f"the same command again: {time.monotonic() - begun:.2f} s")

    tasks = min(count, 20)
    script = (sweep.folder / "jobs" / "array_1.sh").read_text()

    def do_tasks(text):
        for task in range(tasks):
            subprocess.run(["bash", "-c", text], cwd=sweep.place, check=True, capture_output=True,
                           env=dict(os.environ, SLURM_ARRAY_TASK_ID=str(task)))

    def do_sweep():
        sweep.call("runner", "--db", "local.db", "--jobs", "1",
                   *sweep.flags("random", 500, ["--seeds", str(tasks)]))

    each = {}
    script_alone = re.sub("^runner=.*", "runner=true", script, flags=re.M)
    for what, work in [("script alone", lambda: do_tasks(script_alone)),
                       ("task whose run is finished", lambda: do_tasks(script)),
                       ("run of a local sweep", do_sweep), ("task", lambda: do_tasks(script))]:
        if what == "task":
            for database in sweep.databases():
                database.unlink()
                shutil.rmtree(f"{database}.files")
        each[what] = timed(work, tasks)
        print(f"{what}: {each[what][0]:.3f} s, {each[what][1]:.3f} s of processor time")
    added = [task - run for task, run in zip(each["task"], each["run of a local sweep"])]
    print(f"a task adds {added[0]:.3f} s, {added[1]:.3f} s of processor time to its run")
    return submission < MOST_SUBMISSION and added[1] < MOST_ADDED


def main():
    lacking = cluster.missing()
    if lacking:
        print(f"skipped: a Slurm of this machine cannot be started: {lacking}")
        return 77
    binaries, faulty = sys.argv[1:3]
    with tempfile.TemporaryDirectory(prefix="slurm-") as name:
        place = pathlib.Path(name)
        with cluster.Cluster(place) as slurm:
            sweep = Sweep(binaries, faulty, place)
            try:
                if sys.argv[3:4] == ["--measure"]:
                    return 0 if measure(sweep, int(sys.argv[4])) else 1
                else:
                    test(sweep)
                    sweep = Sweep(binaries, faulty, place, "limits")
                    test_limits(sweep, slurm)
            except BaseException:
                if sweep.folder.exists():
                    print(sweep.log())
                raise
    return 0


if __name__ == "__main__":
    sys.exit(main())
