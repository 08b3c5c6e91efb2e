#!/usr/bin/env python3
"""Times dreamsearch and its peers by turns on one core; peers.sh prepares and runs it."""
import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
from datetime import date
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
GOLDEN = ROOT / "tests" / "plugins" / "model_dreamer" / "golden"
OBSERVATIONS, ACTIONS = 24, 6  # walker's, as in our benchmark programs
DECISIONS = 20  # a turn of planner_latency
# What OPENBLAS_CORETYPE may say; None leaves the choice to OpenBLAS.
KERNELS = (None, "Haswell", "Zen", "SkylakeX", "Sapphirerapids")

ONE_THREAD = {
    "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NPROC": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "JAX_PLATFORMS": "cpu",
}


def say(text):
    print(text, file=sys.stderr, flush=True)


class Skipped(Exception):
    """A peer that cannot run here, with the reason."""


class Worker:
    """A peer's process, see turns.py."""

    def __init__(self, python, script, *arguments, **environment):
        environment = {**os.environ, **ONE_THREAD, **environment}
        for name in ("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE"):
            if name not in environment or environment[name] == os.environ.get(name):
                environment.pop(name, None)
        try:
            self.process = subprocess.Popen(
                [python, HERE / script, *arguments], env=environment, text=True, bufsize=1,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        except OSError as error:
            raise Skipped(str(error)) from error
        self.facts = self.read()["facts"]

    def read(self):
        line = self.process.stdout.readline()
        if not line:
            raise Skipped(f"its process ended with {self.process.wait()}")
        answer = json.loads(line)
        if "error" in answer:
            self.process.wait()
            raise Skipped(answer["error"])
        return answer

    def seconds(self, case, seconds, least):
        request = json.dumps({"case": case, "seconds": seconds, "least": least})
        try:
            self.process.stdin.write(request + "\n")
            return self.read()["seconds"]
        except (BrokenPipeError, Skipped) as error:
            raise SystemExit(f"a peer stopped while it was measured at {case}: {error}") from error

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def run(*command, accept=(0,)):
    """What a program of ours prints."""
    result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            check=False)
    if result.returncode not in accept:
        raise SystemExit(f"{Path(command[0]).name} ended with {result.returncode}:\n"
                         f"{result.stderr}")
    return result.stdout


def our_updates(programs, presets):
    names = "|".join(presets)
    text = run(programs / "model_dreamer_benchmark", "--benchmark_format=json",
               f"--benchmark_filter=^Update/({names})_float$")
    units = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}
    return {row["name"].removeprefix("Update/").removesuffix("_float"):
            row["cpu_time"] * units[row["time_unit"]] for row in json.loads(text)["benchmarks"]}


def our_searches(programs, planners):
    text = run(programs / "planner_latency", "--planner", ",".join(planners), str(DECISIONS))
    in_float = re.split(r"^bfloat16\b", text, flags=re.MULTILINE)[0]
    rows = re.findall(r"^(mcts_\w+(?: leaf_batch=\d+)?) +([\d.]+) ", in_float, re.MULTILINE)
    return {label: 1e-3 * float(ms) for label, ms in rows}


def our_steps(programs, tasks):
    # It ends with 1 where a step costs more than it promises beyond the engine's own work.
    text = run(programs / "env_dmc_benchmark", *tasks, accept=(0, 1))
    rows = (line.split() for line in text.splitlines())
    return {row[0]: 1e-6 * float(row[1]) for row in rows if row[0] in tasks}


class Section:
    """One table: what is compared, row by row, and the turns that were taken."""

    def __init__(self, title, unit, scale):
        self.title, self.unit, self.scale = title, unit, scale
        self.rows = []  # (ours, peer, case of the peer)
        self.peers = {}  # name: Worker
        self.notes = []

    def start(self, name, *arguments, **environment):
        say(f"starting {name}")
        try:
            self.peers[name] = Worker(*arguments, **environment)
        except Skipped as reason:
            self.skip(name, reason)
            return
        facts = self.peers[name].facts
        self.notes.append(", ".join(f"{k} {v}" for k, v in facts.items()) + ".")

    def skip(self, name, reason):
        say(f"skipped: {name}: {reason}")
        self.notes.append(f"Skipped: {name}: {reason}")

    def compare(self, turns, ours, seconds, least):
        """Takes the turns and prints the table. ours() measures all our cases; who begins
        alternates. False if there is no peer to compare with."""
        rows = [row for row in self.rows if row[1] in self.peers]
        if not rows:
            print(f"\n## {self.title}\n\nNothing was compared.")
            print("\n".join(self.notes), flush=True)
            return False
        our_turns, peer_turns, calls = [], [], {}

        def peers():
            medians = {}
            for _, peer, case in rows:
                if (peer, case) not in medians:
                    times = self.peers[peer].seconds(case, seconds, least)
                    medians[peer, case] = statistics.median(times)
                    calls[peer, case] = calls.get((peer, case), 0) + len(times)
            peer_turns.append(medians)

        for turn in range(turns):
            say(f"{self.title}: turn {turn + 1} of {turns}")
            order = [lambda: our_turns.append(ours()), peers]
            for party in order if turn % 2 == 0 else reversed(order):
                party()
        for worker in self.peers.values():
            worker.close()
        self.show(rows, our_turns, peer_turns, calls)
        return True

    def show(self, rows, our_turns, peer_turns, calls):
        print(f"\n## {self.title}\n\n| ours | {self.unit} | peer | {self.unit} | calls | "
              "peer / ours | least to most |\n|---|---|---|---|---|---|---|")
        for name, peer, case in rows:
            ours = [turn[name] for turn in our_turns]
            theirs = [turn[peer, case] for turn in peer_turns]
            ratios = [b / a for a, b in zip(ours, theirs)]
            print(f"| {name} | {self.scale * statistics.median(ours):.4g} | {peer} {case} | "
                  f"{self.scale * statistics.median(theirs):.4g} | {calls[peer, case]} | "
                  f"**{statistics.median(ratios):.2f}** | {min(ratios):.2f} to {max(ratios):.2f} |")
        print("\n" + "\n".join(self.notes), flush=True)


def choose_kernel(python, arguments):
    """The setting of OpenBLAS under which the small update is fastest at its best."""
    workers, reason = {}, None
    for kernel in KERNELS:
        environment = {} if kernel is None else {"OPENBLAS_CORETYPE": kernel}
        try:
            workers[kernel] = Worker(python, "torch_update.py", *arguments, **environment)
        except Skipped as error:
            say(f"OpenBLAS kernel {kernel or 'of its own choice'}: {error}")
            reason = reason or error
            if kernel is None and "ModuleNotFoundError" in str(error):
                break
    best = {kernel: [] for kernel in workers}
    for _ in range(3):
        for kernel, worker in workers.items():
            best[kernel] += worker.seconds("fast", 0.5, 2)
    for kernel, worker in workers.items():
        worker.close()
        say(f"OpenBLAS kernel {kernel or 'of its own choice'}: {1e3 * min(best[kernel]):.1f} ms")
    if not workers:
        raise Skipped(reason)
    return min(best, key=lambda kernel: min(best[kernel]))


def compare_updates(options, programs):
    presets = ("fast", "paper")
    section = Section("An update of world model, actor and critic", "ms", 1e3)
    section.rows = [(preset, "PyTorch", preset) for preset in presets]
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for preset in presets:
            file = Path(folder) / f"{preset}.json"
            run(programs / "write_golden_input", "--preset", preset, str(OBSERVATIONS),
                str(ACTIONS), file)
            files.append(f"{preset}={file}")
        say("choosing a kernel of OpenBLAS for PyTorch")
        try:
            kernel = choose_kernel(options.torch_python, [GOLDEN, files[0]])
        except Skipped as reason:
            section.skip("PyTorch", f"{reason} (Debian: apt-get install python3-torch "
                                    "libopenblas0-pthread)")
        else:
            environment = {} if kernel is None else {"OPENBLAS_CORETYPE": kernel}
            section.start("PyTorch", options.torch_python, "torch_update.py", GOLDEN, *files,
                          **environment)
            section.notes.append(f"OPENBLAS_CORETYPE: {kernel or 'unset'}, the fastest here.")
    section.notes.append("Float on both sides. PyTorch's is eager code.")
    return section.compare(options.turns, lambda: our_updates(programs, presets), 1, 1)


def compare_searches(options, programs):
    pairs = {"mcts_pw": "muzero_policy", "mcts_fixed": "muzero_policy",
             "mcts_gumbel": "gumbel_muzero_policy"}
    section = Section("A decision of 50 simulations, sizes of the paper", "ms", 1e3)
    section.rows = [(name + batch, "Mctx", f"{policy}/{roots}") for name, policy in pairs.items()
                    for batch in ("", " leaf_batch=8") for roots in (1, 64)]
    section.start("Mctx", sys.executable, "mctx_search.py")
    section.notes.append(
        "Float on both sides. Ours plans one root a call. NAME/64: Mctx plans 64 roots in one "
        "call, and the figure is a root's share.")
    return section.compare(options.turns, lambda: our_searches(programs, pairs), 1, 5)


def compare_steps(options, programs):
    tasks = options.tasks.split(",")
    section = Section("A control step of the environment", "us", 1e6)
    section.rows = ([(task, "EnvPool", f"{task}/{n}") for task in tasks for n in (1, 16)] +
                    [(task, "dm_control", task) for task in tasks])
    for peer, argument in (("EnvPool", "envpool"), ("dm_control", "dm_control")):
        section.start(peer, sys.executable, "environment_step.py", argument, *tasks)
    engine = run("dpkg-query", "-W", "-f", "${Version}", "libmujoco-dev", accept=(0, 1))
    section.notes.append(f"Ours: MuJoCo {engine or 'of an unknown version'}. EnvPool TASK/N steps "
                         "N environments a call; the figure is one's share.")
    return section.compare(options.turns, lambda: our_steps(programs, tasks), 0.5, 5)


SECTIONS = {"update": compare_updates, "search": compare_searches, "step": compare_steps}


def processor():
    fields = dict(line.split(":", 1) for line in Path("/proc/cpuinfo").read_text().splitlines()
                  if ":" in line)
    fields = {key.strip(): value.strip() for key, value in fields.items()}
    flags = [f for f in ("avx2", "avx512f", "avx512_bf16", "amx_tile") if f in
             fields.get("flags", "").split()]
    return f"{fields.get('model name', 'unknown processor')} ({', '.join(flags) or 'no avx2'})"


def main():
    parser = argparse.ArgumentParser(prog="peers.sh", description=__doc__)
    parser.add_argument("--programs", type=Path, required=True, help=argparse.SUPPRESS)
    parser.add_argument("--turns", type=int, default=5, help="turns of each side (5)")
    parser.add_argument("--only", default=",".join(SECTIONS), help="of update,search,step")
    parser.add_argument("--tasks", default="walker_walk,cheetah_run,cartpole_swingup,humanoid_walk",
                        help="tasks of `step`")
    parser.add_argument("--core", type=int, default=max(os.sched_getaffinity(0)),
                        help="the core to run on (the last)")
    parser.add_argument("--torch-python", default="/usr/bin/python3",
                        help="a Python that has PyTorch (/usr/bin/python3, Debian's)")
    options = parser.parse_args()
    wanted = options.only.split(",")
    if options.turns < 1 or not set(wanted) <= set(SECTIONS):
        parser.error(f"--turns is at least 1, --only names some of {', '.join(SECTIONS)}")
    os.sched_setaffinity(0, {options.core})  # for all that it starts

    commit = subprocess.run(["git", "-C", ROOT, "describe", "--always", "--dirty"], text=True,
                            stdout=subprocess.PIPE, check=False).stdout.strip()
    print(f"# dreamsearch {commit or 'of an unknown commit'} and its peers, {date.today()}\n\n"
          f"{processor()}, core {options.core} of {os.cpu_count()}, one thread. Turns of each "
          f"side: {options.turns}; medians, in processor time. A ratio above 1: the peer takes "
          f"longer. Python {sys.version.split()[0]}. Load before: {os.getloadavg()[0]:.1f}.",
          flush=True)
    compared = [SECTIONS[name](options, options.programs) for name in wanted]
    return 0 if any(compared) else 69


if __name__ == "__main__":
    raise SystemExit(main())
