"""An environment of Gymnasium that says how long each of its steps took, for bridge_benchmark."""

import time

import gymnasium
import numpy


class Timed:
    """The last number of an observation is the seconds of the step that led to it."""

    def __init__(self, id):
        self.env = gymnasium.make(id)
        self.spec = self.env.spec
        self.action_space = self.env.action_space
        self.size = self.env.observation_space.shape[0]
        self.observation_space = gymnasium.spaces.Box(-numpy.inf, numpy.inf, (self.size + 1,))
        self.observed = numpy.zeros(self.size + 1)

    def reset(self, seed=None):
        self.observed[:-1], info = self.env.reset(seed=seed)
        self.observed[-1] = 0
        return self.observed, info

    def step(self, action):
        begin = time.perf_counter()
        observation, reward, terminated, truncated, info = self.env.step(action)
        self.observed[-1] = time.perf_counter() - begin
        self.observed[:-1] = observation
        return self.observed, reward, terminated, truncated, info
