#!/usr/bin/env python3
"""A control step of the dm_control suite's tasks, in dm_control or in EnvPool, timed.

    environment_step.py dm_control|envpool TASK...

Actions are uniform over their bounds, as in env_dmc_benchmark.cc; the start of an episode is
left out where the library lets one. Cases of dm_control are TASK, of EnvPool TASK/N for N
environments stepped by one call (and one thread); units are control steps of one environment.
"""
import os
import sys

from turns import serve

STEPS = 1000  # of an episode
BLOCK = 100  # control steps a call of a case
ENVIRONMENTS = (1, 16)


def dm_control(tasks):
    os.environ["MUJOCO_GL"] = "disable"
    from importlib.metadata import version

    import mujoco
    import numpy
    from dm_control import suite

    def stepper(task):
        domain, _, name = task.partition("_")
        domain = {"cup": "ball_in_cup"}.get(domain, domain)
        environment = suite.load(domain, name, task_kwargs={"random": 1})
        spec = environment.action_spec()
        random = numpy.random.default_rng(1)
        actions = random.uniform(spec.minimum, spec.maximum, (STEPS, *spec.shape))
        done = [STEPS]

        def run():
            if done[0] == STEPS:  # once in ten calls; a median does not see it
                environment.reset()
                done[0] = 0
            for action in actions[done[0]:done[0] + BLOCK]:
                environment.step(action)
            done[0] += BLOCK

        return run, BLOCK

    cases = {task: stepper(task) for task in tasks}
    return {"dm_control": version("dm_control"), "MuJoCo": mujoco.__version__}, cases


def envpool(tasks):
    from importlib.metadata import version

    import envpool as pool
    import numpy

    def stepper(task, count):
        domain, _, name = task.partition("_")
        domain = {"cup": "ball_in_cup"}.get(domain, domain)
        camel = "".join(word.capitalize() for word in f"{domain}_{name}".split("_"))
        environment = pool.make(f"{camel}-v1", env_type="dm", num_envs=count, num_threads=1, seed=1)
        spec = environment.action_spec()
        size = spec.shape[-1]
        low, high = (numpy.broadcast_to(numpy.asarray(x, float), (size,))
                     for x in (spec.minimum, spec.maximum))
        actions = numpy.random.default_rng(1).uniform(low, high, (BLOCK, count, size))
        environment.reset()

        def run():  # an ended episode starts anew inside
            for action in actions:
                environment.step(action)

        return run, BLOCK * count

    cases = {f"{task}/{count}": stepper(task, count) for task in tasks for count in ENVIRONMENTS}
    return {"EnvPool": version("envpool")}, cases


if __name__ == "__main__":
    libraries = {"dm_control": dm_control, "envpool": envpool}
    if len(sys.argv) < 3 or sys.argv[1] not in libraries:
        raise SystemExit(__doc__)
    serve(lambda: libraries[sys.argv[1]](sys.argv[2:]))
