"""What every package promises, asked of its programs alone.

`programs` is the folder of `runner` and `results`; `machine` is where they are called.
"""
import re

# One component of each plugin.
COMPONENTS = ["walker_walk", "mjcf", "gym", "dreamer", "oracle", "tdmpc", "mcts_pw", "random",
              "rollout", "cem"]
# A run of seconds.
TINY = ["run.prefill_steps=1000", "run.pretrain_updates=4", "run.train_every=250",
        "run.batch_size=4", "run.sequence_length=8", "run.eval_episodes=1", "run.eval_every=2000",
        "model.hidden=16", "model.deterministic=16", "model.stochastic=4",
        "model.imagination_starts=8", "model.horizon=3"]


def tiny(environment, planner, *more):
    words = ["--env", environment, "--planner", planner, "--steps", "2000", *more]
    for setting in TINY:
        words += ["--set", setting]
    return words


def lists_every_plugin(machine, programs, cwd="/tmp"):
    """From any folder, and refuses none."""
    text = machine.call(f"{programs}/runner", "list", cwd=cwd)
    for name in COMPONENTS:
        assert re.search(rf"^  {name} ", text, re.M), f"no {name}:\n{text}"
    assert "refused" not in text, text
    return text


def trains_and_reads(machine, programs, cwd):
    """The README's main job, small: runs of a search, and their curve as numbers."""
    machine.call(f"{programs}/runner",
                 *tiny("walker_walk", "mcts_pw", "--seeds", "2", "--set", "planner.simulations=6"),
                 cwd=cwd)
    runs = machine.call(f"{programs}/results", "sql",
                        "select count(*) from run where status = 'finished'", cwd=cwd)
    assert re.search(r"\b2\b", runs), runs
    machine.call(f"{programs}/results", "curves", "--out", "curves.csv", cwd=cwd)
    return machine.call(f"{programs}/results", "list", cwd=cwd)


def loads(machine, programs, plugin, cwd):
    """The plugin `still`, built against the package's SDK: it loads, and a run with it finishes."""
    folder = ["--plugin-path", plugin.parent]
    text = machine.call(f"{programs}/runner", "list", "planners", *folder, cwd=cwd)
    assert re.search(r"^  still +1\.0\.0 +still 1\.0\.0 ", text, re.M), text
    assert "refused" not in text, text
    words = tiny("cartpole_balance", "still", *folder, "--db", "still.db")
    machine.call(f"{programs}/runner", *words, cwd=cwd)
    runs = machine.call(
        f"{programs}/results", "sql", "--db", "still.db",
        "select count(*) from run where planner = 'still' and status = 'finished'", cwd=cwd)
    assert re.search(r"\b1\b", runs), runs


def has_man_pages(machine, programs, pages):
    """One for each program and each of its commands, with every flag of its help. `pages` gives the
    text of a page by its name."""
    for program in ("runner", "results"):
        commands = machine.call(f"{programs}/{program}", "--help")
        names = re.findall(r"^  ([a-z]+) ", commands.split("\nCommands\n")[1], re.M)
        assert len(names) >= 10, names
        for name in ["", *names]:
            page = pages(f"{program}-{name}" if name else program).replace("\\-", "-")
            words = [f"{programs}/{program}", *([name] if name else []), "--help"]
            flags = re.findall(r"^  (?:-h, )?(--[a-z0-9-]+)", machine.call(*words), re.M)
            assert len(flags) >= 2, words
            for flag in flags:
                assert re.search(rf"\\fB(?:-h, )?{flag}[ \\]", page), f"{program} {name}: no {flag}"
