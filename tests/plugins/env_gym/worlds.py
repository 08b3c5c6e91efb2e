"""Environments of the Gymnasium interface that need nothing but NumPy."""

import os
import struct
from subprocess import Popen, run  # noqa: F401

import numpy


class Box:
    def __init__(self, low, high):
        self.low = numpy.asarray(low, dtype=numpy.float32)
        self.high = numpy.asarray(high, dtype=numpy.float32)
        self.shape, self.dtype = self.low.shape, self.low.dtype


class Discrete:
    def __init__(self, n):
        self.n, self.start = n, 0


class Dict:
    def __init__(self, **spaces):
        self.spaces = spaces


class Walk:
    """A point that the action moves, with a little noise; terminal beyond `edge`."""

    observation_space = Box([-numpy.inf] * 2, [numpy.inf] * 2)
    action_space = Box([-1, -1], [1, 3])

    def __init__(self, edge=100.0, stop=None):
        self.edge, self.stop = edge, stop

    def reset(self, seed=None):
        self.random = numpy.random.default_rng(seed)
        self.position, self.steps = self.random.normal(size=2), 0
        return self.position.copy(), {}

    def step(self, action):
        assert action.dtype == numpy.float32 and action.shape == (2,)
        self.position += action + 0.01 * self.random.normal(size=2)
        self.steps += 1
        ended = bool(abs(self.position).max() > self.edge)
        return self.position.copy(), int(ended), ended, self.steps == self.stop, {}


class DrawnWalk(Walk):
    """Draws its position: red the first, green the second; the lower half is black."""

    def __init__(self, render_mode=None, **arguments):
        super().__init__(**arguments)
        self.render_mode = render_mode

    def render(self):
        if self.render_mode != "rgb_array":
            return None
        picture = numpy.zeros((10, 20, 3), dtype=numpy.uint8)
        picture[:5, :, :2] = numpy.clip(100 + 20 * self.position, 0, 255).astype(numpy.uint8)
        return picture


class SavedWalk(Walk):
    """The same without noise, which saves and restores itself."""

    restored = 0

    def step(self, action):
        self.position += action
        return self.position.copy(), 0.0, False, False, {"restored": self.restored}

    def save_state(self):
        return struct.pack("=2d", *self.position)

    def restore_state(self, state):
        self.position = numpy.array(struct.unpack("=2d", state))


class Named(Walk):
    """A dictionary with a picture, a number and a choice."""

    observation_space = Dict(picture=Box(numpy.zeros((2, 3)), numpy.ones((2, 3))),
                             speed=Box(0, 1), kind=Discrete(3))

    def reset(self, seed=None):
        return {"kind": 1, "speed": 0.5, "picture": numpy.arange(6).reshape(2, 3)}, {}


class Free(Walk):
    action_space = Box([-numpy.inf, -1], [numpy.inf, 1])


class Buttons(Walk):
    action_space = Discrete(4)


class Old(Walk):
    def step(self, action):
        return self.position, 0.0, False, {}


class Broken(Walk):
    def step(self, action):
        raise ValueError("the door is locked")


class NotANumber(Walk):
    def step(self, action):
        return numpy.array([0, numpy.nan]), 0.0, False, False, {}


class Crash(Walk):
    def step(self, action):
        os.kill(os.getpid(), 11)


class Outdated(Walk):
    def __init__(self):
        import outdated_world  # noqa: F401


def brief():
    return Walk(stop=3)


class Needy(Walk):
    def __init__(self):
        import a_package_that_nobody_has  # noqa: F401
