#!/usr/bin/env python3
"""An exported agent has in dm_control and in Gymnasium the return that `runner eval` gives it.

worlds_test.py BIN [PACKAGE] trains two small agents with BIN/runner, one of them in Gymnasium with
this Python, and compares mean returns: they are as far apart as chance puts them, and far from an
agent that acts at random. PACKAGE is the folder of the module, if it is not installed. Ends with
77 where dm_control or gymnasium is missing.
"""
import math
import pathlib
import sys
import tempfile

sys.dont_write_bytecode = True
sys.path[:0] = sys.argv[2:3]
try:
    import gymnasium
    import numpy
    from dm_control import suite
except ImportError as error:
    print(f"skipped: {error}; PyPI: see tests/plugins/env_gym/install_worlds.sh")
    sys.exit(77)
import dreamsearch
from programs import Programs

EPISODES = 40
ERRORS = 3.5  # standard errors of the difference; chance passes it once in 2000
LEARNT = 5.5  # and so far apart are the agent and random actions at the least
SMALL = ["run.eval_episodes=1", "run.eval_every=0", "run.prefill_steps=1000", "model.hidden=64",
         "model.deterministic=64", "model.stochastic=16", "run.batch_size=8",
         "run.sequence_length=16", "model.imagination_starts=64"]


class Trainer(Programs):
    def trained(self, name, environment, steps, settings):
        """An agent, and its returns under `runner eval` and those of random actions."""
        words = ["--env", environment, "--planner", "dreamer", "--steps", str(steps)]
        for setting in [*SMALL, *settings]:
            words += ["--set", setting]
        self.call("runner", *words, "--db", f"{name}.db")
        self.call("runner", "export", "1", "--db", f"{name}.db", "--out", f"{name}.safetensors")
        self.call("runner", "eval", "1", "--db", f"{name}.db", "--planner", "dreamer,random",
                  "--episodes", str(EPISODES))
        returns = {}
        for planner in ("dreamer", "random"):
            text = self.call("results", "sql", "--db", f"{name}.db", "--format", "csv",
                             "select e.episode_return from episode e join run r using (run_id) where "
                             f"r.parent_run_id = 1 and r.planner = '{planner}'")
            returns[planner] = numpy.array([float(line) for line in text.split()[1:]])
            assert returns[planner].size == EPISODES, text
        return dreamsearch.Agent(self.folder / f"{name}.safetensors"), returns


def apart(a, b):
    """The difference of the means in its standard errors."""
    error = math.sqrt(a.var(ddof=1) / a.size + b.var(ddof=1) / b.size)
    return abs(a.mean() - b.mean()) / error


def compare(name, played, returns):
    played = numpy.array(played)
    ours = returns["dreamer"]
    said = (f"{name}: {played.mean():.1f} +- {played.std(ddof=1) / math.sqrt(EPISODES):.1f}, "
            f"runner eval {ours.mean():.1f} +- {ours.std(ddof=1) / math.sqrt(EPISODES):.1f}, "
            f"random actions {returns['random'].mean():.1f}")
    assert apart(ours, returns["random"]) > LEARNT, f"the agent has learned too little: {said}"
    assert apart(played, ours) < ERRORS, said
    print(said, flush=True)


def main():
    with tempfile.TemporaryDirectory() as name:
        programs = Trainer(pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(name))
        agent, returns = programs.trained("cartpole", "cartpole_balance", 14000, [])
        environment = suite.load("cartpole", "balance", task_kwargs={"random": 1})
        compare("dm_control", dreamsearch.play(agent, environment, EPISODES), returns)

        agent, returns = programs.trained("pendulum", "gym:Pendulum-v1", 12000,
                                          [f"gym.python={sys.executable}"])
        environment = gymnasium.make("Pendulum-v1")
        compare("Gymnasium", dreamsearch.play(agent, environment, EPISODES, seed=1), returns)
    return 0


if __name__ == "__main__":
    sys.exit(main())
