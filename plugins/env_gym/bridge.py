"""Plays one Python environment for the plugin env_gym, which starts this program.

Requests come in on file descriptor 3 and answers go out on 4. Both are frames: a
little-endian uint32, the bytes after it, and these bytes: one letter, then what follows
here. Numbers are native doubles, texts are UTF-8, a spec and settings are JSON.

    request                                    answer
    M settings                                 m spec           make the environment; first
    R uint32 seed                              r observation    start an episode
    S action                                   s reward terminated truncated observation
    G                                          g bytes          the state, if it can be saved
    P bytes                                    p                go to that state
    V uint32 width, height, camera             v RGB bytes      a picture
    any                                        e text           it failed; the last line says how

A spec's `made_of` says what plays beside the settings: interpreter, packages and the files of a
module that is no package of theirs, each with its version or SHA-256.

What the environment prints goes to the run's log. Over 400 lines: the interpreter is handed this
program as one text and finds no module beside it.
"""

import sys

# Handed a program as a text, Python looks for modules in the current folder first: whoever wrote
# a numpy.py there would be played.
sys.path[:] = [folder for folder in sys.path if folder]

import contextlib
import ctypes
import hashlib
import importlib
import importlib.metadata
import importlib.util
import json
import os
import platform
import select
import signal
import struct
import time
import traceback
import types

REQUESTS, ANSWERS = 3, 4


class Refusal(Exception):
    """What the user can mend; its text is the whole message."""


def came_of_importing(error):
    """Whether a module's own code was running, as it does when it is imported."""
    return isinstance(error, ImportError) or any(
        frame.f_code.co_name == "<module>" for frame, _ in traceback.walk_tb(error.__traceback__))


def user_module(name):
    """The installed module NAME, or the file NAME.py wherever it lies."""
    if not name.endswith(".py"):
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            file = name.replace(".", os.sep) + ".py"
            if error.name != name.partition(".")[0] or not os.path.exists(file):
                raise
            raise Refusal(f"no module {name} is installed, and the current folder is not searched; "
                          f"a file is named with its ending: module={file}") from error
    spec = importlib.util.spec_from_file_location(os.path.basename(name)[:-3], name)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    sys.path.insert(0, os.path.dirname(os.path.abspath(name)))
    spec.loader.exec_module(module)
    return module


def is_installed(module):
    """Whether a module is of the interpreter or of a package, and no file of the user's own."""
    path = getattr(module, "__file__", None)
    parts = path.split(os.sep) if path else ["site-packages"]
    library = os.path.dirname(os.__file__) + os.sep
    return "site-packages" in parts or "dist-packages" in parts or path.startswith(library)


def with_neighbours(module):
    """A module and what it imported of the user's own from its folder."""
    folder = os.path.dirname(os.path.abspath(module.__file__)) + os.sep
    return [module] + [other for other in list(sys.modules.values())
                       if other is not module and not is_installed(other)
                       and os.path.abspath(other.__file__).startswith(folder)]


DRAWING = {"OpenGL", "glfw", "imageio"}  # what is imported of these hangs on the machine


def version_of(package):
    """The version of an imported package, None if it has none."""
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        return importlib.metadata.version(package.__name__)
    version = getattr(package, "__version__", None)
    return version if isinstance(version, str) else None


def made_of(module):
    """{name: version or SHA-256} of what plays: the interpreter, the packages that it has imported,
    and of MODULE, if there is one, its file and those of its neighbours.
    """
    found = {"python": f"{platform.python_implementation()} {platform.python_version()}"}
    for name, package in list(sys.modules.items()):
        path = getattr(package, "__file__", None) or ""
        if "." in name or name.startswith("_") or name in DRAWING:
            continue
        if {"site-packages", "dist-packages"} & set(path.split(os.sep)):
            version = version_of(package)
            if version is not None:
                found[name] = version
    if module is not None:
        folder = os.path.dirname(module.__file__)
        for other in with_neighbours(module):
            with open(other.__file__, "rb") as source:
                name = os.path.relpath(other.__file__, folder)
                found[name] = hashlib.sha256(source.read()).hexdigest()
    return found


def made_by(module, name, arguments):
    """The environment that MODULE calls NAME: a class, a function of its own, or what it has
    registered with Gymnasium.
    """
    maker = getattr(module, name, None)
    if maker is None:
        gymnasium = sys.modules.get("gymnasium")
        if gymnasium is None or name not in gymnasium.registry:
            raise Refusal(f"module {module.__name__} has no class '{name}'")
        return gymnasium.make(name, **arguments)
    # What else a module holds, such as a Popen that it imported, is not called.
    is_world = (callable(getattr(maker, "reset", None)) and callable(getattr(maker, "step", None))
                if isinstance(maker, type) else
                isinstance(maker, types.FunctionType) and maker.__module__ == module.__name__)
    if not is_world:
        raise Refusal(f"'{name}' of module {module.__name__} makes no environment: expected a class "
                      "with the methods reset and step")
    return maker(**arguments)


class GymnasiumPlayer:
    """Any environment of the Gymnasium interface."""

    def __init__(self, settings):
        arguments = settings["arguments"]
        self.module = None
        if settings["module"]:
            self.module = user_module(settings["module"])
            self.env = made_by(self.module, settings["id"], arguments)
        else:
            module, colon, name = settings["id"].partition(":")
            if colon:
                raise Refusal(f"id '{settings['id']}': expected a name without a colon; the module is a "
                              f"setting, id={name} and module={module}")
            import gymnasium

            self.env = gymnasium.make(settings["id"], **arguments)
        self.step_limit = getattr(getattr(self.env, "spec", None), "max_episode_steps", None)
        inner = getattr(self.env, "unwrapped", self.env)
        self.saver = inner if hasattr(inner, "save_state") and hasattr(inner, "restore_state") else None
        space = self.env.action_space
        if not all(hasattr(space, part) for part in ("low", "high", "shape")):
            raise Refusal(
                f"the action space is {type(space).__name__}; expected Box: the planners choose "
                "real-valued actions, discrete ones are not supported")
        self.action_shape, self.action_type = space.shape, space.dtype
        self.low = [float(x) for x in space.low.reshape(-1)]
        self.high = [float(x) for x in space.high.reshape(-1)]
        self.parts, self.flatten = flattener(self.env.observation_space)
        # MuJoCo's environments know their step; of others only the pace of their pictures is known.
        frames = (getattr(inner, "metadata", None) or {}).get("render_fps", 1)
        self.control_seconds = float(getattr(inner, "dt", 0) or 1 / frames)

    def reset(self, seed):
        answer = self.env.reset(seed=seed)
        if not (isinstance(answer, tuple) and len(answer) == 2):
            raise Refusal("reset returned no pair (observation, info); expected Gymnasium's "
                          "interface, not the older one of gym")
        return self.flatten(answer[0])

    def step(self, action):
        answer = self.env.step(action.astype(self.action_type).reshape(self.action_shape))
        if not (isinstance(answer, tuple) and len(answer) == 5):
            raise Refusal("step returned no five values (observation, reward, terminated, "
                          "truncated, info); expected Gymnasium's interface, not the older one of gym")
        observation, reward, terminated, truncated, _ = answer
        return float(reward), bool(terminated), bool(truncated), self.flatten(observation)

    def render(self):
        return self.env.render()

    def drawing(self, settings):
        """One that draws: itself, or made anew."""
        if getattr(self.env, "render_mode", None) == "rgb_array":
            return self
        try:
            return GymnasiumPlayer({**settings, "arguments": {**settings["arguments"], "render_mode": "rgb_array"}})
        except TypeError as error:
            raise Refusal(f"it cannot be made with render_mode='rgb_array', which draws: {error}") from error


class ControlSuitePlayer:
    """A task of dm_control.suite; its id is domain-task."""

    module = None
    saver = None

    def __init__(self, settings):
        import numpy
        from dm_control import suite

        domain, dash, task = settings["id"].partition("-")
        if not dash:
            raise Refusal(f"id '{settings['id']}': expected domain-task such as walker-walk")
        self.random_state = numpy.random.RandomState
        self.env = suite.load(domain, task, task_kwargs={"random": 0, **settings["arguments"]})
        specification = self.env.action_spec()
        self.action_shape = specification.shape
        self.low = [float(x) for x in numpy.broadcast_to(specification.minimum, self.action_shape).reshape(-1)]
        self.high = [float(x) for x in numpy.broadcast_to(specification.maximum, self.action_shape).reshape(-1)]
        self.parts = [(name, int(numpy.prod(part.shape, dtype=int)))
                      for name, part in self.env.observation_spec().items()]
        self.step_limit = round(self.env._step_limit) if self.env._step_limit < 1e9 else None
        self.control_seconds = float(self.env.control_timestep())
        self.concatenate = lambda observation: numpy.concatenate(
            [numpy.asarray(part, dtype=numpy.float64).reshape(-1) for part in observation.values()])

    def reset(self, seed):
        self.env.task._random = self.random_state(seed)
        return self.concatenate(self.env.reset().observation)

    def step(self, action):
        moment = self.env.step(action.reshape(self.action_shape))
        terminated = moment.last() and moment.discount == 0
        return (float(moment.reward or 0), terminated, moment.last() and not terminated,
                self.concatenate(moment.observation))

    def render(self):
        return self.env.physics.render(480, 640, camera_id=0)

    def drawing(self, _):
        return self


def flattener(space, prefix=""):
    """([(name, size)], function from an observation to a vector) of a Gymnasium space.

    Boxes are laid out in C order. Dictionaries and tuples come in the order of their space
    (Gymnasium sorts the keys of a plain dict). A discrete value is one-hot.
    """
    import numpy

    kind = type(space).__name__
    name = prefix or "observation"
    if kind == "Dict":
        keys = list(space.spaces)
        inner = [flattener(space.spaces[key], f"{prefix}/{key}" if prefix else str(key)) for key in keys]
    elif kind == "Tuple":
        keys = list(range(len(space.spaces)))
        inner = [flattener(part, f"{name}/{key}") for key, part in zip(keys, space.spaces)]
    elif kind == "Discrete":
        size, start = int(space.n), int(space.start)

        def one_hot(value):
            vector = numpy.zeros(size)
            vector[int(value) - start] = 1
            return vector

        return [(name, size)], one_hot
    elif kind in ("Box", "MultiBinary", "MultiDiscrete"):
        size = int(numpy.prod(space.shape, dtype=int))
        return [(name, size)], lambda value: numpy.asarray(value, dtype=numpy.float64).reshape(-1)
    else:
        raise Refusal(f"the observation space has a part of kind {kind} ('{name}'); expected Box, "
                      "Discrete, MultiBinary, MultiDiscrete, Dict or Tuple")
    parts = [part for found, _ in inner for part in found]
    return parts, lambda value: numpy.concatenate(
        [flatten(value[key]) for key, (_, flatten) in zip(keys, inner)])


class Bridge:
    def __init__(self):
        self.player = None
        self.lived = []  # the requests of this episode, for one that draws

    def make(self, body):
        settings = self.settings = json.loads(body.decode())
        kind = {"gym": GymnasiumPlayer, "dm": ControlSuitePlayer}[settings["kind"]]
        try:
            self.player = kind(settings)
        except Exception as error:
            if not came_of_importing(error):
                raise
            traceback.print_exc()
            raise Refusal(f"{sys.executable} cannot import what '{settings['id']}' needs: "
                          f"{type(error).__name__}: {error}") from error
        import numpy

        self.numpy = numpy
        player = self.player
        for end, bounds in (("low", player.low), ("high", player.high)):
            given = settings[f"action_{end}"]
            for i, bound in enumerate(bounds):
                if abs(bound) != float("inf"):
                    continue
                if given is None:
                    raise Refusal(
                        f"action {i} has no {end} bound ({bound:g}) and planners choose between "
                        "bounds; set env.action_low and env.action_high")
                bounds[i] = given
        self.size = sum(size for _, size in player.parts)
        self.actions = len(player.low)
        state_bytes = 0
        if player.saver is not None:
            player.reset(0)
            state_bytes = len(self.state())
        return b"m" + json.dumps({
            "observation": player.parts,
            "action_low": player.low,
            "action_high": player.high,
            "episode_steps": player.step_limit or 0,
            "control_seconds": player.control_seconds,
            "state_bytes": state_bytes,
            "made_of": made_of(player.module),
        }).encode()

    def observation(self, vector):
        if vector.size != self.size:
            raise Refusal(f"an observation has {vector.size} numbers; its space has {self.size}")
        return self.numpy.ascontiguousarray(vector, dtype=self.numpy.float64).tobytes()

    def reset(self, body):
        self.lived = [body]
        return b"r" + self.observation(self.player.reset(struct.unpack("=I", body)[0]))

    def step(self, body):
        action = self.numpy.frombuffer(body, dtype=self.numpy.float64)
        self.lived.append(body)
        reward, terminated, truncated, vector = self.player.step(action)
        return b"s" + struct.pack("=d??", reward, terminated, truncated) + self.observation(vector)

    def state(self):
        state = self.player.saver.save_state()
        if not isinstance(state, (bytes, bytearray)):
            raise Refusal(f"save_state returned {type(state).__name__}; expected bytes")
        return bytes(state)

    def save(self, _):
        return b"g" + self.state()

    def restore(self, body):
        self.player.saver.restore_state(body)
        return b"p"

    def render(self, body):
        width, height, camera = struct.unpack("=III", body)
        if camera != 0:
            raise Refusal(f"camera {camera}: only camera 0 is known")
        drawing = self.player.drawing(self.settings)
        if drawing is not self.player:
            # It lives what this one has lived.
            drawing.reset(struct.unpack("=I", self.lived[0])[0])
            if self.player.saver is not None:
                drawing.saver.restore_state(self.state())
            else:
                for action in self.lived[1:]:
                    drawing.step(self.numpy.frombuffer(action, dtype=self.numpy.float64))
            self.player = drawing
        picture = self.player.render()
        if picture is None:
            raise Refusal("render() returned no picture")
        picture = self.numpy.asarray(picture, dtype=self.numpy.uint8)
        rows = self.numpy.arange(height) * picture.shape[0] // height
        columns = self.numpy.arange(width) * picture.shape[1] // width
        return b"v" + picture[rows][:, columns, :3].tobytes()

    def answer(self, request):
        handlers = {b"M": self.make, b"R": self.reset, b"S": self.step, b"G": self.save,
                    b"P": self.restore, b"V": self.render}
        try:
            return handlers[request[:1]](request[1:])
        except Refusal as refusal:
            return b"e" + str(refusal).encode()
        except Exception as error:  # whatever the environment raises is its user's to read
            traceback.print_exc()
            return b"e" + f"{type(error).__name__}: {error}".encode()


class Requests:
    """What comes in, a frame at a time."""

    LOOKING = 100e-6  # seconds to look for a request before sleeping, as python_process.cc does

    def __init__(self):
        self.came = bytearray()
        self.poll = select.poll()
        self.poll.register(REQUESTS, select.POLLIN)

    def read(self, count):
        while len(self.came) < count:
            part = os.read(REQUESTS, 65536)
            if not part:
                sys.exit(0)  # the run has ended
            self.came += part
        data = bytes(self.came[:count])
        del self.came[:count]
        return data

    def next(self):
        end = time.perf_counter() + self.LOOKING
        while not self.poll.poll(0) and time.perf_counter() < end:
            os.sched_yield()
        return self.read(struct.unpack("=I", self.read(4))[0])


def end_with_the_run():
    """Outlives neither the run, nor a signal that the run answers with a checkpoint."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2):
        signal.signal(number, signal.SIG_IGN)
    set_parent_death_signal = 1  # PR_SET_PDEATHSIG of <sys/prctl.h>
    ctypes.CDLL(None).prctl(set_parent_death_signal, signal.SIGKILL)


def main():
    end_with_the_run()
    bridge = Bridge()
    requests = Requests()
    while True:
        answer = bridge.answer(requests.next())
        frame = struct.pack("=I", len(answer)) + answer
        while frame:
            frame = frame[os.write(ANSWERS, frame):]


if __name__ == "__main__":
    main()
