"""A world for `runner --env gym:Recorded`: numbers that drift, with NumPy alone.

It writes down what the agent saw and did, each world in a file of its own: episodes are played side
by side.
"""
import json
import os
import uuid

import numpy


class Box:
    def __init__(self, low, high):
        self.low, self.high = numpy.array(low, float), numpy.array(high, float)
        self.shape, self.dtype = self.low.shape, self.low.dtype


class Recorded:
    def __init__(self, folder):
        self.action_space = Box([-2, 0], [2, 1])
        self.observation_space = Box([-9] * 5, [9] * 5)
        self.file = os.path.join(folder, uuid.uuid4().hex)

    def reset(self, seed):
        self.random = numpy.random.RandomState(seed)
        self.state = self.random.normal(size=5)
        self.steps = 0
        self.write("reset", self.state)
        return self.state.copy(), {}

    def step(self, action):
        self.write("step", action)
        pull = numpy.array([action[0], action[1], -action[0], 1 - action[1], 0])
        self.state = 0.9 * self.state + 0.1 * pull + 0.05 * self.random.normal(size=5)
        self.steps += 1
        self.write("observation", self.state)
        return self.state.copy(), float(-abs(self.state[0] - 1)), False, self.steps == 40, {}

    def write(self, what, numbers):
        with open(self.file, "a") as file:
            print(json.dumps([what, list(map(float, numbers))]), file=file)
