"""What the reliability harnesses share: a small training run, and what must hold after a fault.

The run learns a real task with a real model and makes a checkpoint every few steps, in a folder
of its own. Its result digest covers every decision, so that equal digests mean equal runs.
"""
import os
import pathlib
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time

SKIPPED = 77  # CTest shows it as skipped

# System calls that change a file or the name of one.
WRITE_CLASS = ("pwrite64,write,pwritev,writev,fsync,fdatasync,ftruncate,fallocate,rename,renameat,"
               "renameat2,link,linkat,unlink,unlinkat,mkdir,mkdirat")


class Programs:
    """Where `runner` and `results` are, and how they are called in a folder."""

    def __init__(self, bin_dir, preload=None):
        self.bin = pathlib.Path(bin_dir).resolve()
        self.preload = preload

    def environment(self, folder):
        own = dict(os.environ, TMPDIR=str(folder))  # shares its cores with no other run
        # Tasks of the tests: checkpoints come between episodes, and those of short20 are short.
        own["DREAMSEARCH_PLUGIN_PATH"] = str(self.bin.parent / "tests/integration/early")
        # Of a build with sanitizers: a preloaded library comes first, and under ptrace no leak can be
        # looked for.
        own["ASAN_OPTIONS"] = ":".join(filter(None, [
            os.environ.get("ASAN_OPTIONS"), "verify_asan_link_order=0", "detect_leaks=0"]))
        if self.preload:
            own["LD_PRELOAD"] = self.preload
        return own

    def words(self, program, *words):
        return [str(self.bin / program), *map(str, words)]

    def start(self, folder, program, *words, before=()):
        return subprocess.Popen([*before, *self.words(program, *words)], cwd=folder,
                                env=self.environment(folder), stdin=subprocess.DEVNULL,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                errors="replace", start_new_session=True)

    def call(self, folder, program, *words, timeout=300, before=()):
        process = self.start(folder, program, *words, before=before)
        try:
            out, err = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            out, err = process.communicate()
            err += "\n(the harness ended it after %d s)" % timeout
        return process.returncode, out, err


# Searches of a few candidates.
SMALL_SEARCHES = {
    "cem": ("candidates=8", "elites=2", "iterations=1", "horizon=3"),
    "icem": ("candidates=8", "elites=2", "iterations=1", "horizon=3"),
    "mppi": ("candidates=8", "elites=2", "iterations=1", "actor_candidates=2"),
    "random_shooting": ("candidates=8", "horizon=3"),
    "rollout": ("actor_candidates=4", "uniform_candidates=4", "depth=3"),
    **{name: ("simulations=4",) for name in ("mcts_pw", "mcts_fixed", "hoot", "mcts_gumbel")},
}


def training(db="r.db", steps=240, env="short20", planner="random", model="dreamer",
             seeds=("--seeds", 1), jobs=1, more=()):
    """Arguments of a run of moments that learns and makes a checkpoint every 40 steps, if the
    episodes of the task are as short."""
    words = ["--env", env, "--planner", planner, "--model", model, "--db", db, "--steps", steps,
             *seeds, "--jobs", jobs]
    settings = ["run.action_repeat=1", "run.prefill_steps=80", "run.pretrain_updates=1", "run.train_every=20",
                "run.batch_size=2", "run.sequence_length=4", "run.eval_episodes=1",
                "run.eval_every=100000", "run.checkpoint_every=40"]
    if model == "dreamer":
        settings += ["model.hidden=8", "model.deterministic=8", "model.stochastic=2",
                     "model.imagination_starts=2", "model.horizon=2"]
    if model == "tdmpc":
        settings += ["model.width=8", "model.encoder_width=8", "model.simplices=1"]
    for name in planner.split(","):
        settings += ["%s.%s" % (name, setting) for setting in SMALL_SEARCHES.get(name, ())]
    for setting in settings:
        words += ["--set", setting]
    return [str(word) for word in [*words, *more]]


class Place:
    """A folder that goes when the harness has done with it."""

    def __enter__(self):
        self.path = pathlib.Path(tempfile.mkdtemp(prefix="dreamsearch_reliability_"))
        return self.path

    def __exit__(self, *ignored):
        for _ in range(50):
            shutil.rmtree(self.path, ignore_errors=True)
            if not self.path.exists():
                return
            time.sleep(0.1)


def query(db, sql):
    """Rows; none if the file or the table is not there."""
    try:
        connection = sqlite3.connect("file:%s?mode=ro" % db, uri=True, timeout=20)
        try:
            return connection.execute(sql).fetchall()
        finally:
            connection.close()
    except sqlite3.Error:
        return []


def value(db, sql):
    rows = query(db, sql)
    return rows[0][0] if rows else None


def digests(db):
    return dict(query(db, "SELECT (SELECT name FROM task WHERE task.task_id = run.task_id) || ' ' "
                          "|| planner || ' ' || model || ' ' || seed, result_digest FROM run"))


class Witness:
    """Reads what is committed while the run goes on: none of it may be missing afterwards."""

    def __init__(self, db):
        self.db, self.seen, self.stop = db, 0, threading.Event()
        self.thread = threading.Thread(target=self.watch)

    def watch(self):
        while not self.stop.wait(0.01):
            steps = value(self.db, "SELECT count(*) FROM step")
            self.seen = max(self.seen, steps or 0)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *ignored):
        self.stop.set()
        self.thread.join()


def worker_of(supervisor, deadline=60):
    """The worker process, stopped before it has written; None if the command ended first."""
    children = "/proc/%d/task/%d/children" % (supervisor.pid, supervisor.pid)
    end = time.time() + deadline
    while time.time() < end and supervisor.poll() is None:
        try:
            pids = pathlib.Path(children).read_text().split()
        except OSError:
            return None
        for pid in pids:
            try:
                words = pathlib.Path("/proc/%s/cmdline" % pid).read_bytes().split(b"\0")
                if b"worker" in words[1:2]:
                    os.kill(int(pid), 19)
                    return int(pid)
            except OSError:
                pass
        time.sleep(0.0002)
    return None


class Injected:
    """strace on a process that is running: does `fault` to its system calls."""

    def __init__(self, pid, fault, calls=WRITE_CLASS):
        self.tracer = subprocess.Popen(
            ["strace", "-f", "-qq", "-o", "/dev/null", "-e", "trace=" + calls, "-e",
             "inject=%s:%s" % (calls, fault), "-p", str(pid)],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        status = "/proc/%d/status" % pid
        for _ in range(20000):
            try:
                if "TracerPid:\t0\n" not in pathlib.Path(status).read_text():
                    break
            except OSError:
                break
            time.sleep(0.0005)

    def wait(self):
        try:
            self.tracer.wait(timeout=60)
        except subprocess.TimeoutExpired:
            self.tracer.kill()
            self.tracer.wait()


def tracing_is_allowed():
    """Whether strace is there and may trace and inject; if not, why."""
    if shutil.which("strace") is None:
        return "strace is not installed (Debian's package strace)"
    probe = subprocess.run(["strace", "-qq", "-o", "/dev/null", "-e", "inject=write:error=EIO",
                            "true"], capture_output=True, text=True)
    return "" if probe.returncode == 0 else "ptrace is forbidden here: " + probe.stderr.strip()


def wait_until_nobody_works(folder, seconds=30):
    """Until every process that works in the folder has ended."""
    end = time.time() + seconds
    while time.time() < end:
        busy = False
        for entry in os.listdir("/proc"):
            if not entry.isdigit() or int(entry) == os.getpid():
                continue
            try:
                busy = busy or os.readlink("/proc/%s/cwd" % entry) == str(folder)
            except OSError:
                pass
        if not busy:
            return True
        time.sleep(0.01)
    return False


class Faults:
    """What did not hold; the harness fails if there is any."""

    def __init__(self):
        self.found = []

    def add(self, where, what):
        self.found.append("%s: %s" % (where, what))
        print("FAULT %s: %s" % (where, what[:600]), flush=True)

    def status(self):
        return 1 if self.found else 0


def check_whole(programs, folder, db, seen, where, faults):
    """After a fault and before anything else: no committed row is gone, no batch is torn."""
    path = folder / db
    if not path.exists():
        if seen:
            faults.add(where, "the database is gone; %d steps had been committed" % seen)
        return
    try:
        connection = sqlite3.connect(path, timeout=20)
        try:
            if connection.execute("SELECT count(*) FROM sqlite_schema").fetchone()[0] == 0:
                return  # it was killed before the tables were committed
            integrity = connection.execute("PRAGMA integrity_check").fetchone()[0]
            if integrity != "ok":
                faults.add(where, "integrity_check: " + integrity)
            there = connection.execute("SELECT count(*) FROM step").fetchone()[0]
        finally:
            connection.close()
    except sqlite3.DatabaseError as error:
        faults.add(where, "the database cannot be read: %s" % error)
        return
    if there < seen:
        faults.add(where, "%d steps had been committed, %d are there" % (seen, there))
    code, out, err = programs.call(folder, "results", "verify", "--db", db)
    if code != 0:
        faults.add(where, "results verify: exit %d: %s" % (code, (out + err).strip()))


def check_resumes(programs, folder, words, expected, where, faults, db="r.db"):
    """The same command finishes the run with the digests of an undisturbed one."""
    code, out, err = programs.call(folder, "runner", *words)
    if code != 0:
        faults.add(where, "the same command again: exit %d: %s" % (code, err.strip()[-500:]))
    elif digests(folder / db) != expected:
        faults.add(where, "another result: %s, expected %s" % (digests(folder / db), expected))
    else:
        code, out, err = programs.call(folder, "results", "verify", "--db", db)
        if code != 0:
            faults.add(where, "results verify at the end: exit %d: %s" % (code, (out + err).strip()))


def undisturbed(programs, words, db="r.db"):
    with Place() as folder:
        code, out, err = programs.call(folder, "runner", *words)
        if code != 0:
            sys.exit("the undisturbed run: exit %d: %s" % (code, err))
        return digests(folder / db)
