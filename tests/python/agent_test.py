#!/usr/bin/env python3
"""dreamsearch.Agent does what `runner` does: the same actions on the same observations.

agent_test.py BIN [PACKAGE] trains tiny agents of every model with BIN/runner in a recorded world,
plays evaluation episodes, and shows the observations to agents made of what BIN/runner exports.
PACKAGE is the folder of the module, if it is not installed. Ends with 77 where there is no NumPy.
"""
import json
import os
import pathlib
import sys
import tempfile

sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = sys.argv[2:3]
try:
    import numpy
except ImportError:
    print("skipped: no numpy; Debian: python3-numpy")
    sys.exit(77)
import dreamsearch
from programs import Programs

# Every way of acting: each activation, with and without normalisation, repeated actions.
AGENTS = {
    "dreamer plain": ["model.acting_latent=mean", "model.norm=none", "run.action_repeat=2"],
    "dreamer normalised": ["model.acting_latent=mean", "model.norm=layer",
                           "model.normalise_observations=false", "run.action_repeat=1"],
    "tdmpc": ["run.action_repeat=2"],
}
SIZES = {
    "dreamer": ["model.hidden=24", "model.deterministic=16", "model.stochastic=6",
                "model.actor_learning_rate=0.01", "model.imagination_starts=8", "model.horizon=3",
                "run.sequence_length=8"],
    "tdmpc": ["model.width=24", "model.simplices=2", "run.sequence_length=3"],
}
# Single precision, 40 decisions through a recurrence. In units of how far the actions of different
# observations are apart: an agent that overlooked them would be off by 1.
TOLERANCE = 1e-3


def trained(programs, name):
    """The weights of a trained agent, and what it saw and did in two episodes afterwards."""
    model = name.split()[0]
    records = programs.folder / f"{name} records"
    records.mkdir()
    arguments = json.dumps({"folder": str(records)})
    database = ["--db", f"{name}.db"]
    words = ["--env", "gym:Recorded", "--model", model, "--planner", "dreamer", "--steps", "800",
             *database]
    for setting in [f"gym.module={HERE / 'recorded.py'}", f"gym.python={sys.executable}",
                    f"gym.arguments={arguments}", "run.prefill_steps=200",
                    "run.pretrain_updates=20", "run.batch_size=4",
                    "run.train_every=20", "run.eval_episodes=1",
                    *AGENTS[name], *SIZES[model]]:
        words += ["--set", setting]
    programs.call("runner", *words)
    # A recorded run loads a module from a folder of one's own only if the command names that.
    trusted = ["--plugin-path", str(HERE)]
    programs.call("runner", "export", "1", *database, *trusted, "--out", f"{name}.safetensors")
    for record in records.iterdir():
        record.unlink()
    programs.call("runner", "eval", "1", *database, *trusted, "--planner", "dreamer", "--episodes",
                  "2", "--jobs", "1")
    worlds = [[json.loads(line) for line in record.read_text().splitlines()]
              for record in records.iterdir()]
    return programs.folder / f"{name}.safetensors", worlds


def acts_as_the_runner(programs, name):
    path, worlds = trained(programs, name)
    agent = dreamsearch.Agent(path)
    assert agent.info["env"].startswith("gym:Recorded"), agent.info
    low, high = numpy.array([-2, 0]), numpy.array([2, 1])
    steps = begun = 0
    furthest = 0.0
    actions = []
    for what, numbers in (moment for world in worlds for moment in world):
        if what != "step":
            observation = numbers
        if what == "reset":
            agent.reset()
            begun += 1
        elif what == "step":
            expected = (numpy.array(numbers) - low) / (high - low) * 2 - 1
            actions.append(expected)
            furthest = max(furthest, numpy.abs(agent.act(observation) - expected).max())
            steps += 1
    assert steps >= 80 and begun >= 2, (steps, begun)
    spread = numpy.std(actions, axis=0).min()
    assert furthest < TOLERANCE * spread, f"{name}: {furthest}, spread {spread}"
    print(f"{name}: {steps} actions, at most {furthest:.1e} off, spread {spread:.1e}")


def refuses_what_it_cannot_play(folder, path):
    agent = dreamsearch.Agent(path)
    for wrong, said in ((numpy.zeros(4), "has 5 numbers, found 4"),
                        (numpy.full(5, numpy.nan), "not finite")):
        try:
            agent.act(wrong)
        except ValueError as error:
            assert said in str(error), error
        else:
            raise AssertionError(f"no complaint about {wrong}")
    for content in (b"", b"\xff" * 100, path.read_bytes()[:1000]):
        (folder / "broken").write_bytes(content)
        try:
            dreamsearch.Agent(folder / "broken")
        except ValueError as error:
            assert "is no file that `runner export` wrote" in str(error), error
        else:
            raise AssertionError("no complaint about a broken file")


def main():
    os.environ.pop("DREAMSEARCH_PLUGIN_PATH", None)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        programs = Programs(pathlib.Path(sys.argv[1]).resolve(), folder)
        for agent in AGENTS:
            acts_as_the_runner(programs, agent)
        refuses_what_it_cannot_play(folder, folder / "tdmpc.safetensors")
    return 0


if __name__ == "__main__":
    sys.exit(main())
