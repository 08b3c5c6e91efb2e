"""Episodes of an agent in an environment of dm_control or Gymnasium."""

import numpy as np

from .agent import flat


def one_vector(space):
    """The function from an observation of a Gymnasium space to a vector, laid out as env_gym does:
    boxes in C order, dictionaries and tuples in their order, a discrete value one-hot."""
    kind = type(space).__name__
    if kind == "Discrete":
        return lambda value: np.eye(int(space.n))[int(value) - int(space.start)]
    if kind == "Dict":
        parts = [(key, one_vector(part)) for key, part in space.spaces.items()]
    elif kind == "Tuple":
        parts = [(i, one_vector(part)) for i, part in enumerate(space.spaces)]
    else:
        return flat
    return lambda value: np.concatenate([to_vector(value[key]) for key, to_vector in parts])


class ControlSuite:
    """An environment of dm_control."""

    def __init__(self, environment):
        self.environment = environment
        specification = environment.action_spec()
        self.low, self.high = specification.minimum, specification.maximum
        self.shape = specification.shape

    def reset(self, seed):
        del seed  # the task's own, given to suite.load
        return self.environment.reset().observation

    def step(self, action):
        moment = self.environment.step(action)
        return moment.observation, float(moment.reward or 0), moment.last()


class Gymnasium:
    """An environment of Gymnasium."""

    def __init__(self, environment):
        self.environment = environment
        space = environment.action_space
        self.low, self.high, self.shape = space.low, space.high, space.shape
        self.type = space.dtype
        self.to_vector = one_vector(environment.observation_space)

    def reset(self, seed):
        observation, _ = self.environment.reset(seed=seed)
        return self.to_vector(observation)

    def step(self, action):
        observation, reward, terminated, truncated, _ = self.environment.step(
            action.astype(self.type))
        return self.to_vector(observation), float(reward), terminated or truncated


def bounds(agent, player):
    """The environment's, or those that the run was given where it has none."""
    given = agent.config["environment"]["parameters"]
    ends = []
    for name, end in (("action_low", player.low), ("action_high", player.high)):
        end = np.broadcast_to(np.asarray(end, np.float64), player.shape).reshape(-1)
        if not np.isfinite(end).all():
            if given.get(name) is None:
                raise ValueError(f"the action has no finite bounds, and the run no {name}")
            end = np.where(np.isfinite(end), end, given[name])
        if end.size != agent.action_size:
            raise ValueError(f"the agent's actions have {agent.action_size} components, the "
                             f"environment's {end.size}")
        ends.append(end)
    return ends


def play(agent, environment, episodes=1, seed=None):
    """The returns, undiscounted, of whole episodes.

    Gymnasium's episodes begin with the seeds `seed`, `seed` + 1 and so on; those of dm_control
    depend on the random state of the task.
    """
    player = (ControlSuite if hasattr(environment, "action_spec") else Gymnasium)(environment)
    low, high = bounds(agent, player)
    returns = []
    for episode in range(episodes):
        observation = player.reset(None if seed is None else seed + episode)
        agent.reset()
        total, last = 0.0, False
        while not last:
            action = low + (agent.act(observation) + 1) / 2 * (high - low)
            observation, reward, last = player.step(action.reshape(player.shape))
            total += reward
        returns.append(total)
    return returns
