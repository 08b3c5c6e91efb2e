"""A trained agent as `runner export` wrote it, in NumPy.

The names and shapes of the arrays, and what is computed with them, are on the pages of the models:
plugins/model_dreamer/README.md and plugins/model_tdmpc/README.md.
"""

import json
import math
import struct

import numpy as np

SIMPLEX = 8  # numbers of a latent of tdmpc that sum to 1
NORM_EPSILON = 1e-5


def read_safetensors(path):
    """({name: float32 array}, {name: text}) of the arrays and the metadata of a file."""
    with open(path, "rb") as file:
        data = file.read()
    try:
        (length,) = struct.unpack_from("<Q", data)
        header = json.loads(data[8 : 8 + length])
        metadata = header.pop("__metadata__", {})
        arrays = {}
        for name, entry in header.items():
            if entry["dtype"] != "F32":
                raise ValueError(f"{name} has numbers of kind {entry['dtype']}, expected F32")
            begin, end = entry["data_offsets"]
            values = np.frombuffer(data[8 + length + begin : 8 + length + end], "<f4")
            arrays[name] = values.reshape(entry["shape"])
    except (struct.error, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{path} is no file that `runner export` wrote: {error}") from error
    return arrays, metadata


def flat(observation):
    """One vector of doubles: arrays in C order, dictionaries and tuples in their order."""
    if hasattr(observation, "values"):
        parts = list(observation.values())
    elif isinstance(observation, tuple):
        parts = list(observation)
    else:
        return np.asarray(observation, dtype=np.float64).reshape(-1)
    return np.concatenate([flat(part) for part in parts])


def sigmoid(x):
    return np.float32(0.5) * (1 + np.tanh(np.float32(0.5) * x))  # nothing overflows


def softplus(x):
    return np.logaddexp(x, np.float32(0))


def elu(x):
    return np.where(x > 0, x, np.expm1(np.minimum(x, 0)))


def mish(x):
    return x * np.tanh(softplus(x))


def simnorm(x):
    """A softmax over every SIMPLEX numbers."""
    rows = x.reshape(-1, SIMPLEX)
    rows = np.exp(rows - rows.max(axis=1, keepdims=True))
    return (rows / rows.sum(axis=1, keepdims=True)).reshape(-1)


class Network:
    """The layers of an exported model, by their names."""

    def __init__(self, arrays):
        self.arrays = arrays

    def affine(self, name, *inputs):
        return self.arrays[f"{name}.weight"] @ np.concatenate(inputs) + self.arrays[f"{name}.bias"]

    def hidden(self, name, activation, *inputs):
        """Affine, layer normalisation if the model has it, activation."""
        x = self.affine(name, *inputs)
        if f"{name}.norm_scale" in self.arrays:
            x = (x - x.mean()) / np.sqrt(x.var() + np.float32(NORM_EPSILON))
            x = x * self.arrays[f"{name}.norm_scale"] + self.arrays[f"{name}.norm_shift"]
        return activation(x)

    def layers(self, name):
        """How many hidden layers NAME.0, NAME.1, ... there are."""
        count = 0
        while f"{name}.{count}.weight" in self.arrays:
            count += 1
        return count

    def stack(self, name, activation, *inputs, last=None):
        """All hidden layers; the last one may have an activation of its own."""
        count = self.layers(name)
        x = np.concatenate(inputs)
        for i in range(count):
            x = self.hidden(f"{name}.{i}", last if last and i + 1 == count else activation, x)
        return x


class Dreamer:
    """Encoder, recurrent state and actor of the model `dreamer`."""

    def __init__(self, network, settings):
        self.network, self.settings = network, settings
        self.observation_size = network.arrays["encoder.0.weight"].shape[1]
        self.action_size = network.arrays["actor.out.weight"].shape[0] // 2
        self.stochastic = network.arrays["posterior.out.weight"].shape[0] // 2
        self.deterministic = network.arrays["gru.recurrent.weight"].shape[1]

    def initial(self):
        return (np.zeros(self.stochastic, np.float32), np.zeros(self.deterministic, np.float32))

    def observe(self, state, action, observation, random):
        network = self.network
        z, h = state
        x = network.hidden("recurrence", elu, z, action)
        given = network.affine("gru.input", x)
        kept = network.affine("gru.recurrent", h)
        d = self.deterministic
        r = sigmoid(given[:d] + kept[:d])
        u = sigmoid(given[d : 2 * d] + kept[d : 2 * d])
        c = np.tanh(given[2 * d :] + r * kept[2 * d :])
        h = (1 - u) * c + u * h
        e = network.stack("encoder", elu, observation)
        raw = network.affine("posterior.out", network.hidden("posterior.0", elu, h, e))
        z = raw[: self.stochastic]
        if self.settings["acting_latent"] == "sample":
            std = softplus(raw[self.stochastic :]) + np.float32(self.settings["min_std"])
            z = z + std * random.standard_normal(self.stochastic, np.float32)
        return z, h

    def mode(self, state):
        m = self.network.affine("actor.out", self.network.stack("actor", elu, *state))
        limit = np.float32(self.settings["actor_mean_limit"])
        return np.tanh(limit * np.tanh(m[: self.action_size] / limit))


class Tdmpc:
    """Encoder and actor of the model `tdmpc`."""

    def __init__(self, network, settings):
        del settings
        self.network = network
        self.observation_size = network.arrays["encoder.0.weight"].shape[1]
        self.action_size = network.arrays["actor.out.weight"].shape[0] // 2

    def initial(self):
        return None

    def observe(self, state, action, observation, random):
        del state, action, random
        return self.network.stack("encoder", mish, observation, last=simnorm)

    def mode(self, state):
        m = self.network.affine("actor.out", self.network.stack("actor", mish, state))
        return np.tanh(m[: self.action_size])


MODELS = {"dreamer": Dreamer, "tdmpc": Tdmpc}


class Agent:
    """Acts as the planner `dreamer` does: the actor's mode, without a search.

    Agent(path) reads what `runner export` wrote. Call `reset` when an episode begins and `act` at
    every environment step. Where the run repeated its actions, `act` decides at every
    `action_repeat`-th step and returns the same action in between; `action_repeat=1` makes it
    decide at each call, for an environment that repeats actions itself.

    `info` has the metadata of the file (run, task, planner, model, version, step), `config` all
    resolved settings of the run. A model that acts on a sampled latent draws it from `seed`.
    """

    def __init__(self, path, action_repeat=None, seed=0):
        arrays, self.info = read_safetensors(path)
        name = self.info.get("model")
        if name not in MODELS:
            raise ValueError(f"{path} has the model {name!r}. Known: {', '.join(MODELS)}")
        self.config = json.loads(self.info["config"])
        self.action_repeat = action_repeat or self.config["run"]["action_repeat"]
        settings = self.config["model"]["parameters"]
        try:
            self._model = MODELS[name](Network(arrays), settings)
        except KeyError as error:
            raise ValueError(f"{path} lacks {error}, which the model {name!r} needs") from error
        self._standardise = None
        if settings["normalise_observations"] and "observation_statistics.mean" in arrays:
            deviation = np.sqrt(arrays["observation_statistics.variance"].astype(np.float64))
            self._standardise = (
                arrays["observation_statistics.mean"].astype(np.float64),
                1 / np.maximum(deviation, settings["observation_floor"]),
                settings["observation_clip"])
        self.reset(seed)

    @property
    def observation_size(self):
        return self._model.observation_size

    @property
    def action_size(self):
        return self._model.action_size

    def reset(self, seed=None):
        """Begins an episode. With a seed also the random numbers begin anew."""
        if seed is not None:
            self._random = np.random.default_rng(seed)
        self._state = self._model.initial()
        self._action = np.zeros(self.action_size, np.float32)
        self._steps = 0

    def act(self, observation):
        """The action of this environment step, each component in [-1, 1].

        `observation` is a vector, or a dictionary or tuple of arrays in the order of the task's
        observation (dm_control's and Gymnasium's have it).
        """
        if self._steps % self.action_repeat == 0:
            x = flat(observation)
            if x.size != self.observation_size:
                raise ValueError(f"an observation of {self.info.get('env')} has "
                                 f"{self.observation_size} numbers, found {x.size}")
            if not all(map(math.isfinite, x)):
                raise ValueError("the observation is not finite")
            if self._standardise:
                mean, inverse, clip = self._standardise
                x = np.clip((x - mean) * inverse, -clip, clip)
            self._state = self._model.observe(self._state, self._action, x.astype(np.float32),
                                              self._random)
            self._action = self._model.mode(self._state)
        self._steps += 1
        return self._action.astype(np.float64)
