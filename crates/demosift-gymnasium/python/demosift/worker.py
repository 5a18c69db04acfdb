"""Plays one Gymnasium environment for demosift, or trains and plays policies by a trainer of the user's own.

demosift asks over standard input and is answered over standard output.
It hands this file to the user's own interpreter, so it needs numpy, for environments gymnasium, and nothing of demosift.
Where the wheel of demosift can be imported too, whole episodes are played here by the same code that steps it otherwise.
What is asked and answered are frames: the length of the payload (u32), one letter, the payload; all numbers little-endian.

| asked | payload | answered | payload |
|---|---|---|---|
| `O` open | JSON: environment | `G` greeting | JSON: versions, sizes, names |
| `M` measure | JSON: names of numbers in info, steps of an episode | `K` done | JSON: names of all there are |
| `R` reset | seed, u64 | `T` turn | see `turn` |
| `S` step | action in the environment's own unit, f64 each | `T` turn | see `turn` |
| `I` into a recorded state | length of the model's text, u32, 0 if there is none; the text; the state, f64 each | `T` turn | see `turn` |
| `Q` which state | none | `A` state | f64 each |
| `V` view | the most columns and rows of a picture, u32 each | `V` view | columns and rows, u32 each; red, green, blue of each pixel, u8 each |
| `P` play | policy and seeds, see `src/whole.rs` | `W` played | episodes; before it may stand any number of `H`, for "still playing" |
| `L` learn with | JSON: trainer, sizes of an observation and an action | `K` done | JSON: versions |
| `D` demonstration | its number of steps, u32; observations and actions, f32 each | `K` done | none |
| `N` now train | seed, u64 | `K` done | JSON: the path of an ONNX file, if the policy is one |
| `B` begin an episode | none | `K` done | none |
| `A` act | observation, f32 each | `A` action | f64 each |
| | | `E` error | JSON: what was wrong |

It ends when standard input does, and with its parent.
"""

import ctypes
import json
import os
import signal
import struct
import sys
from collections.abc import Mapping

PROTOCOL = 5
LETTERS = {"open": b"O", "measure": b"M", "reset": b"R", "step": b"S", "play": b"P", "put": b"I", "state": b"Q", "view": b"V"}
LEARNING = {"learn": b"L", "demonstration": b"D", "train": b"N", "begin": b"B", "act": b"A"}
TERMINATED, TRUNCATED = 1, 2
#: What every environment measures, and the name of what a function says of a whole episode.
ALWAYS, SCORE = ("reward", "terminated"), "score"
PR_SET_PDEATHSIG = 1
DEEPEST = 8
#: Flags and reward stand before the observation of a turn.
TURN_HEAD = struct.Struct("<Bd")


class Refused(Exception):
    """The environment works, and demosift cannot use it; says why, and what would help."""

    def __init__(self, message, hint=None):
        super().__init__(message)
        self.hint = hint


class Fault(Exception):
    """A function of the user's beside the environment did what cannot be used; says which function and what."""


def end_with_parent(parent):
    """The kernel ends this process with its parent, even in the middle of a step."""
    try:
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    except (OSError, AttributeError):
        return
    # It may have ended before that; whoever has lost its parent belongs to the first process.
    if os.getppid() == 1 and parent != 1:
        os._exit(1)


def take_streams():
    """The streams of the frames. What the environment prints goes to standard error, and it finds nothing to read."""
    asked, answers = os.dup(0), os.dup(1)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return os.fdopen(asked, "rb"), answers


def make(asked):
    """The environment that is asked for; one that is to be looked at draws into arrays."""
    look = {"render_mode": "rgb_array"} if asked.get("pictures") else {}
    if look and not os.environ.get("DISPLAY"):
        # Where there is no screen, MuJoCo draws off it.
        os.environ.setdefault("MUJOCO_GL", "egl")
    if asked.get("kind") == "robosuite":
        adapter = module_of(asked["adapter"], "demosift_robosuite")
        return adapter.make(asked["robosuite"], asked["longest"], bool(look), Refused)
    import gymnasium

    if asked.get("spec") is not None:
        spec = spec_of(asked["spec"])
        if not asked.get("trust"):
            check_registered(spec)
        return gymnasium.make(spec, disable_env_checker=True, **look)
    if asked["kind"] == "gymnasium":
        return gymnasium.make(asked["name"], disable_env_checker=True, **look)
    found = named(asked)
    if not callable(found):
        return found
    return found(**look) if look and takes(found, "render_mode") else found()


def follow(env):
    """Looks from the camera that follows the robot, where a model of MuJoCo has one and nobody chose another."""
    try:
        import mujoco

        inner = env.unwrapped
        camera = mujoco.mj_name2id(inner.model, mujoco.mjtObj.mjOBJ_CAMERA, "track")
        if camera >= 0 and inner.camera_id is None and inner.camera_name is None:
            inner.mujoco_renderer.camera_id = camera
    except (ImportError, AttributeError):
        return


def takes(function, name):
    """Whether a function can be called with an argument of this name."""
    import inspect

    try:
        parameters = inspect.signature(function).parameters
    except (TypeError, ValueError):
        return False
    return name in parameters or any(one.kind is inspect.Parameter.VAR_KEYWORD for one in parameters.values())


def named(asked):
    """What has this name in a file or module."""
    import importlib

    found = import_file(asked["file"]) if asked["kind"] == "file" else importlib.import_module(asked["module"])
    for part in asked["name"].split("."):
        found = getattr(found, part)
    return found


def module_of(text, name):
    """The module that is this text."""
    import types

    module = types.ModuleType(name)
    sys.modules[name] = module
    # The name of what this file itself is called in a traceback, which is nobody's place.
    exec(compile(text, "<string>", "exec"), vars(module))
    return module


def spec_of(text):
    """A specification as a set holds it, which may be of another version of Gymnasium."""
    import dataclasses

    from gymnasium.envs.registration import EnvSpec

    known = {field.name for field in dataclasses.fields(EnvSpec) if field.init}
    parsed = {"additional_wrappers": [], **json.loads(text)}
    return EnvSpec.from_json(json.dumps({name: value for name, value in parsed.items() if name in known}))


def check_registered(spec):
    """Refuses code that a set names and that nobody registered here: of the environment, or of a wrapper around it."""
    import gymnasium

    known = gymnasium.registry.get(spec.id)
    named = [] if known is not None and known.entry_point == spec.entry_point else [spec.entry_point]
    named += [wrapper.entry_point for wrapper in spec.additional_wrappers]
    for entry_point in named:
        if not str(entry_point).startswith("gymnasium.wrappers."):
            raise Refused(
                f"the set names the environment '{spec.id}' with the code '{entry_point}', which is not registered here",
                "install the package that registers it, or add --trust-set to run the code that the set names",
            )


def import_file(path):
    """The module in a file, whose neighbors it can import."""
    import importlib.util

    folder, name = os.path.dirname(path), os.path.splitext(os.path.basename(path))[0]
    known = sys.modules.get(name)
    if known is not None and getattr(known, "__file__", None) == path:
        # An environment and what measures it may lie in one file, which is run once.
        return known
    sys.path.insert(0, folder)
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def leaves(space, name="", depth=0):
    """The parts of an observation space by the order of their names: name, space, and how to get there."""
    from gymnasium import spaces

    if depth > DEEPEST:
        raise Refused(f"the observation space is nested more than {DEEPEST} deep")
    if isinstance(space, spaces.Dict):
        inner = [(key, key, part) for key, part in sorted(space.spaces.items())]
    elif isinstance(space, spaces.Tuple):
        # Those of a set have the names that they have there.
        names = getattr(space, "names", None) or [f"_index_{index}" for index in range(len(space.spaces))]
        inner = [(label, index, part) for index, (label, part) in enumerate(zip(names, space.spaces))]
    else:
        return [(name or "observation", space, ())]
    found = []
    for label, key, part in inner:
        below = leaves(part, f"{name}/{label}" if name else str(label), depth + 1)
        found.extend((label, leaf, (key, *way)) for label, leaf, way in below)
    return found


def flattener(name, space, way):
    """How a part of an observation becomes numbers, and how many."""
    import numpy
    from gymnasium import spaces

    if isinstance(space, spaces.Box):
        is_image = len(space.shape) >= 3 or (space.dtype == numpy.uint8 and len(space.shape) == 2)
        if is_image:
            raise Refused(
                f"the part '{name}' of an observation is an image of shape {space.shape}, and policies of demosift read numbers",
                "leave images out of the observation, such as by gymnasium.wrappers.FilterObservation",
            )
        single = numpy.dtype("<f4")
        numbers = lambda value: numpy.asarray(value, dtype=single).ravel()
        return numbers, int(numpy.prod(space.shape, dtype=int))
    if isinstance(space, (spaces.Discrete, spaces.MultiDiscrete, spaces.MultiBinary)):
        numbers = lambda value: numpy.asarray(spaces.flatten(space, value), dtype="<f4")
        return numbers, spaces.flatdim(space)
    raise Refused(
        f"the part '{name}' of an observation is a {type(space).__name__}, which has no fixed numbers",
        "wanted Box, Discrete, MultiDiscrete or MultiBinary, alone or in Dict and Tuple",
    )


def action_bounds(space):
    """What the action space can be: a Box with finite bounds."""
    import numpy
    from gymnasium import spaces

    if not isinstance(space, spaces.Box):
        raise Refused(
            f"the action space is {type(space).__name__}, and policies of demosift act in a Box of numbers",
            "wanted gymnasium.spaces.Box with finite bounds",
        )
    if not numpy.issubdtype(space.dtype, numpy.floating):
        raise Refused(f"actions are of type {space.dtype}, and must be floating-point numbers")
    low, high = space.low.ravel().astype(float), space.high.ravel().astype(float)
    for number, (least, greatest) in enumerate(zip(low, high)):
        if not (numpy.isfinite(least) and numpy.isfinite(greatest) and least < greatest):
            raise Refused(
                f"action {number} has the bounds {least} and {greatest}, and both must be finite, the first below the second",
                "give the action_space of the environment the bounds that it has in truth",
            )
    return [[float(least), float(greatest)] for least, greatest in zip(low, high)]


def limit_of(env):
    """After how many steps the environment stops an episode by itself, if that can be seen."""
    spec = getattr(env, "spec", None)
    limits = [getattr(spec, "max_episode_steps", None)]
    while env is not None:
        # What TimeLimit keeps; a spec is missing where the environment is not registered.
        limits.append(vars(env).get("_max_episode_steps") if hasattr(env, "__dict__") else None)
        env = vars(env).get("env") if hasattr(env, "__dict__") else None
    return min((int(limit) for limit in limits if isinstance(limit, int) and limit > 0), default=None)


def step_secs(env):
    """Simulated seconds of a step by `dt`, which is the environment's word."""
    dt = getattr(getattr(env, "unwrapped", env), "dt", None)
    return seconds(lambda: dt() if callable(dt) else dt)


def picture_secs(env):
    """Seconds of a picture, most often those of a step; but a rate of pictures is easily copied from elsewhere."""
    metadata = getattr(getattr(env, "unwrapped", env), "metadata", None) or {}
    return seconds(lambda: 1.0 / float(metadata["render_fps"]))


def seconds(found):
    """A number that can be the seconds of a step, or None."""
    try:
        secs = float(found())
        return secs if 0.0 < secs < 1e6 else None
    except Exception:
        return None


def versions(env):
    """Of all that the physics depend on."""
    import gymnasium

    own = type(getattr(env, "unwrapped", env)).__module__.split(".")[0]
    simulators = ["mujoco", "pybullet", "robosuite", "dm_control", "Box2D", "sapien", "torch", "jax"]
    return {"gymnasium": gymnasium.__version__, **versions_of([*simulators, own])}


def versions_of(names):
    """Of Python, numpy and those of these modules that are imported."""
    import platform
    from importlib import metadata

    import numpy

    found = {"python": platform.python_version(), "numpy": numpy.__version__}
    for name in names:
        module = sys.modules.get(name)
        if module is None or name in found:
            continue
        try:
            version = getattr(module, "__version__", None) or metadata.version(name)
        except Exception:
            continue
        if isinstance(version, str):
            found[name] = version
    return found


def player_of_episodes():
    """What plays whole episodes: demosift's own code, where the wheel is installed here; its version tells whether it is the same."""
    try:
        from demosift import _demosift

        return _demosift, _demosift.PLAYER
    except Exception:  # Whatever is wrong with it, the environment can be stepped.
        return None, None


def as_number(value):
    """A number of info as a float; None if it is none."""
    import numbers

    import numpy

    if isinstance(value, (bool, numbers.Real, numpy.bool_)):
        return float(value)
    if isinstance(value, numpy.ndarray) and value.size == 1 and value.dtype.kind in "biuf":
        return float(value.ravel()[0])
    return None


class Own:
    """A function of the user's beside the environment: `measure` after each step, or `score` of an episode."""

    def __init__(self, asked, wanted):
        self.words = asked["words"]
        try:
            self.function = named(asked)
        except Exception as error:
            raise Fault(f"{self.words} cannot be imported: {in_words(error)}") from None
        if not callable(self.function):
            raise Fault(f"{self.words} is of type {type(self.function).__name__}; wanted a function {wanted}")

    def call(self, when, *arguments):
        try:
            return self.function(*arguments)
        except Exception as error:
            raise Fault(f"{self.words} failed {when}: {in_words(error)}") from None

    def number(self, value, when, name=None):
        """A finite number that it returned, under a name if there are several."""
        number, what = as_number(value), self.words if name is None else f"{self.words}: '{name}'"
        if number is None:
            verb = "returned an object" if name is None else "is"
            raise Fault(f"{what} {verb} of type {type(value).__name__} {when}; wanted a number")
        if not -float("inf") < number < float("inf"):
            raise Fault(f"{what} {'returned' if name is None else 'is'} {number} {when}; wanted a finite number")
        return number


class Measure(Own):
    """More numbers of each step, by `measure(env, obs, reward, info)`, which returns them by name."""

    def __init__(self, asked, taken):
        super().__init__(asked, "measure(env, obs, reward, info), which returns numbers by name")
        self.taken, self.names = taken, None

    def numbers(self, env, step, observation, reward, info):
        when = f"after step {step}"
        found = self.call(when, env, observation, reward, info)
        if not isinstance(found, Mapping):
            raise Fault(
                f"{self.words} returned an object of type {type(found).__name__} {when}; wanted a dict of numbers, such as "
                "{'gap': 0.1}"
            )
        numbers = {str(name): self.number(value, when, name) for name, value in found.items()}
        if self.names is None:
            self.names = set(numbers)
            if not numbers:
                raise Fault(f"{self.words} returned an empty dict {when}; wanted at least one number")
        if set(numbers) != self.names:
            raise Fault(
                f"{self.words} returned {listed(numbers)} {when}, and {listed(self.names)} after the first; wanted the same names "
                "each time"
            )
        taken = [name for name in numbers if name in self.taken or as_number(info.get(name)) is not None]
        if taken:
            raise Fault(f"{self.words} returned '{taken[0]}' {when}, which is measured already; wanted another name")
        return numbers


class Score(Own):
    """The heuristic of a whole episode, by `score(observations, actions, rewards)`."""

    def __init__(self, asked, numpy):
        super().__init__(asked, "score(observations, actions, rewards), which returns a number")
        self.numpy = numpy
        self.begin()

    def begin(self, observation=None):
        self.observations, self.actions, self.rewards = [] if observation is None else [observation], [], []

    def add(self, observation, action, reward):
        self.observations.append(observation)
        self.actions.append(action)
        self.rewards.append(reward)

    def number_of_episode(self):
        when = f"on an episode of {len(self.actions)} steps"
        arrays = self.numpy.stack(self.observations), self.numpy.stack(self.actions), self.numpy.array(self.rewards)
        return self.number(self.call(when, *arrays), when)


def in_words(error):
    """What was raised, and where."""
    found = problem(error)
    return found["message"] + (f" ({found['place']})" if found["place"] else "")


def listed(names):
    return ", ".join(f"'{name}'" for name in sorted(names)) or "nothing"


class Player:
    """The environment with what is known of it."""

    def __init__(self, env, own=None):
        import numpy

        own = own or {}
        self.numpy = numpy
        self.env = env
        self.score = Score(own["score"], numpy) if own.get("score") else None
        taken = {*ALWAYS, SCORE} if self.score else set(ALWAYS)
        self.own = Measure(own["measure"], taken) if own.get("measure") else None
        #: Steps of an episode, once that is known.
        self.horizon = None
        for wanted in ("reset", "step", "observation_space", "action_space"):
            if not hasattr(env, wanted):
                raise Refused(
                    f"what was made is of type {type(env).__name__}, without '{wanted}', so it is no environment of Gymnasium",
                    "wanted a gymnasium.Env, or a function without arguments that returns one",
                )
        self.bounds = action_bounds(env.action_space)
        self.parts = []
        for name, space, way in leaves(env.observation_space):
            numbers, width = flattener(name, space, way)
            self.parts.append((name, way, numbers, width))
        self.shape, self.dtype = env.action_space.shape, env.action_space.dtype
        self.doubles = numpy.dtype("<f8")
        self.always, self.measured, self.steps = set(), [], 0
        self.width = sum(width for _, _, _, width in self.parts)

    def reset(self, seed):
        import random

        # For environments that draw from these and not from their own generator.
        random.seed(seed)
        self.numpy.random.seed(seed % 2**32)
        observation, _ = self.env.reset(seed=seed)
        return self.begun(observation)

    def begun(self, observation):
        self.steps = 0
        if self.score is not None:
            self.score.begin(self.flat(observation).copy())
        return self.turn(observation, 0.0, False, False, None)

    def step(self, action):
        action = self.numpy.frombuffer(action, self.doubles).astype(self.dtype).reshape(self.shape)
        return self.turn(*self.advance(action))

    def advance(self, action):
        """One step, with what the user measures of it among the numbers of info."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        reward, terminated, truncated = float(reward), bool(terminated), bool(truncated)
        self.steps += 1
        if self.own is not None:
            info = {**info, **self.own.numbers(self.env, self.steps, observation, reward, info)}
        if self.score is not None:
            # An environment may write into what it was given and has returned.
            self.score.add(self.flat(observation).copy(), self.numpy.array(action, dtype=float).ravel(), reward)
            is_over = terminated or truncated or self.steps == self.horizon
            info = {**info, SCORE: self.score.number_of_episode() if is_over else 0.0}
        return observation, reward, terminated, truncated, info

    def put(self, payload):
        """Goes on from a recorded state, where the environment can be put into one."""
        (length,) = struct.unpack_from("<I", payload)
        model = payload[4 : 4 + length].decode() if length else None
        state = self.numpy.frombuffer(payload[4 + length :], self.doubles)
        return self.begun(self.env.unwrapped.put_into(model, state.copy()))

    def state(self):
        return self.numpy.asarray(self.env.unwrapped.state(), dtype=self.doubles).tobytes()

    def view(self, most_columns, most_rows):
        """What the environment looks like now, made smaller by a whole number to fit."""
        mode = getattr(self.env, "render_mode", None)
        if mode != "rgb_array":
            raise Refused(
                f"it has the render_mode {mode!r}, and pictures are made of 'rgb_array'",
                "let the function that makes it take render_mode, or make it with render_mode=\"rgb_array\"",
            )
        within = getattr(getattr(self.env, "unwrapped", self.env), "render_within", None)
        picture = self.numpy.asarray(within(most_columns, most_rows) if within else self.env.render())
        if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != self.numpy.uint8 or not picture.size:
            raise Refused(
                f"its render() returned {picture.dtype} of the shape {picture.shape}, and a picture is uint8 of the shape "
                "(rows, columns, 3)"
            )
        rows, columns, _ = picture.shape
        by = max(-(-rows // most_rows), -(-columns // most_columns))
        if by > 1:
            # Smaller than that in one direction it would be nothing.
            rows, columns = max(rows // by, 1), max(columns // by, 1)
            picture = picture[: rows * by, : columns * by]
            blocks = picture.reshape(rows, picture.shape[0] // rows, columns, picture.shape[1] // columns, 3)
            picture = blocks.mean(axis=(1, 3)).round().astype(self.numpy.uint8)
        return struct.pack("<II", columns, rows) + self.numpy.ascontiguousarray(picture).tobytes()

    def turn(self, observation, reward, terminated, truncated, info):
        """u8 with bits 1 terminated and 2 truncated, reward f64, observation f32 each, measured numbers f64 each."""
        flags = (TERMINATED if terminated else 0) | (TRUNCATED if truncated else 0)
        told = TURN_HEAD.pack(flags, reward) + self.flat(observation).tobytes()
        if self.measured:
            measured = [self.measure(info, name) for name in self.measured]
            told += struct.pack(f"<{len(measured)}d", *measured)
        return told

    def measure(self, info, name):
        """A number of info; 0 after the reset. One that was there after the first step of all has to be there always."""
        if info is None:
            return 0.0
        number = as_number(info.get(name))
        if number is None and name in self.always:
            raise Refused(f"info has no number '{name}' after step {self.steps}, and had one after the first step")
        return 0.0 if number is None else number

    def flat(self, observation):
        parts = []
        for name, way, numbers, width in self.parts:
            value = observation
            for key in way:
                value = value[key]
            part = numbers(value)
            if part.size != width:
                raise Refused(f"the part '{name}' of an observation has {part.size} numbers, and its space says {width}")
            parts.append(part)
        return parts[0] if len(parts) == 1 else self.numpy.concatenate(parts)

    def numbers_in_info(self, whole_episode, limit):
        """Names of the numbers in info after one step, or after any step of an episode."""
        self.reset(0)
        if hasattr(self.env.action_space, "seed"):
            self.env.action_space.seed(0)
        found, seen = [], 0
        while True:
            _, _, terminated, truncated, info = self.advance(self.env.action_space.sample())
            seen += 1
            names = [str(name) for name, value in info.items() if as_number(value) is not None]
            if seen == 1:
                self.always = set(names)
            found.extend(name for name in names if name not in found)
            if not whole_episode or terminated or truncated or seen == limit:
                return sorted(found)

    def sizes(self):
        """Numbers in an observation, and numbers of info that are measured."""
        return self.width, len(self.measured)

    def greeting(self, limit):
        info = self.numbers_in_info(False, 1)
        inner = getattr(self.env, "unwrapped", self.env)
        return {
            "protocol": PROTOCOL,
            "versions": versions(self.env),
            "name": getattr(getattr(self.env, "spec", None), "id", None),
            "parts": [[name, width] for name, _, _, width in self.parts],
            "bounds": self.bounds,
            "info": info,
            "limit": limit_of(self.env),
            "usual": getattr(inner, "usual_steps", None),
            "is_put": hasattr(inner, "put_into"),
            "step_secs": step_secs(self.env),
            "picture_secs": picture_secs(self.env),
        }


class Learner:
    """A trainer, the demonstrations that it is to learn from, and the policy that it made of them."""

    def __init__(self, asked):
        import numpy

        self.numpy = numpy
        self.observation, self.action = asked["observation"], asked["action"]
        self.train_with = named(asked)
        if not callable(self.train_with):
            raise Refused(
                f"'{asked['name']}' is of type {type(self.train_with).__name__}, and a trainer is a function",
                "wanted train(demonstrations, seed), which returns a policy: a function from an observation to an action",
            )
        self.demonstrations, self.policy, self.steps = [], None, 0

    def versions(self):
        return versions_of(["torch", "jax", "sklearn", "tensorflow", "stable_baselines3", "imitation", "onnxruntime"])

    def add(self, payload):
        """One more demonstration: arrays of its own, which the trainer may change."""
        (steps,) = struct.unpack_from("<I", payload)
        numbers = self.numpy.frombuffer(payload, self.numpy.dtype("<f4"), offset=4).astype(self.numpy.float32)
        observations, actions = self.numpy.split(numbers, [steps * self.observation])
        self.demonstrations.append(
            Demonstration(observations.reshape(steps, self.observation), actions.reshape(steps, self.action))
        )

    def train(self, seed):
        """Trains once; says which file the policy is, if it is one."""
        import random

        random.seed(seed)
        self.numpy.random.seed(seed)
        if "torch" in sys.modules:
            sys.modules["torch"].manual_seed(seed)
        made = self.train_with(self.demonstrations, seed)
        path = None
        if isinstance(made, (str, os.PathLike)):
            path = os.path.abspath(os.fspath(made))
            made = onnx_policy(path, self.observation)
        if not callable(made):
            raise Refused(
                f"it returned {'None' if made is None else f'an object of type {type(made).__name__}'}, which is no policy",
                "wanted a function (or an object that can be called) from an observation to an action, or the path of an .onnx file",
            )
        # What it learned from is not needed any more.
        self.policy, self.demonstrations = made, []
        return json.dumps({"onnx": path}).encode()

    def begin(self):
        self.steps = 0
        reset = getattr(self.policy, "reset", None)
        if callable(reset):
            reset()
        return b"null"

    def act(self, payload):
        observation = self.numpy.frombuffer(payload, self.numpy.dtype("<f4")).astype(self.numpy.float32)
        action = self.policy(observation)
        self.steps += 1
        if hasattr(action, "detach"):
            action = action.detach().cpu().numpy()
        action = self.numpy.asarray(action, dtype="<f8").ravel()
        if action.size != self.action:
            raise Refused(f"its policy returned {action.size} numbers at step {self.steps}, and an action has {self.action}")
        if not self.numpy.isfinite(action).all():
            wrong = action[~self.numpy.isfinite(action)][0]
            raise Refused(f"its policy returned {wrong} in the action at step {self.steps}, and must return finite numbers")
        return action.tobytes()


class Demonstration:
    """An episode: observations [T, obs] and actions [T, act]."""

    def __init__(self, observations, actions):
        self.observations, self.actions = observations, actions

    def __len__(self):
        return len(self.actions)

    def __repr__(self):
        return f"Demonstration({len(self)} steps)"


def onnx_policy(path, width):
    """The policy in a file of ONNX: its one input [1, obs] to its first output."""
    import numpy

    if not path.endswith(".onnx") or not os.path.isfile(path):
        raise Refused(
            f"it returned the path '{path}', which is no ONNX file", "wanted a policy, or the path of an .onnx file that is there"
        )
    try:
        import onnxruntime
    except ImportError:
        raise Refused(
            f"it returned the ONNX file '{path}', and onnxruntime is not installed in this interpreter",
            "install onnxruntime there, or return a function from an observation to an action",
        ) from None
    try:
        session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    except Exception as error:
        raise Refused(f"its ONNX file '{path}' cannot be opened: {error}") from None
    inputs = session.get_inputs()
    if len(inputs) != 1 or inputs[0].type not in ("tensor(float)", "tensor(double)"):
        found = ", ".join(f"{one.name}: {one.type}" for one in inputs)
        raise Refused(
            f"its ONNX file has the inputs {found}", "wanted one input of floating-point numbers, [1, obs]; or return a function"
        )
    name, kind = inputs[0].name, numpy.float64 if inputs[0].type == "tensor(double)" else numpy.float32
    return lambda observation: session.run(None, {name: observation.astype(kind).reshape(1, width)})[0]


class Desk:
    """Answers one frame after the other; `beat` says that an answer is still worked on."""

    def __init__(self, beat):
        self.player = None
        self.learner = None
        self.beat = beat
        self.episodes = None

    def answer(self, letter, payload):
        if letter in LEARNING.values():
            return self.learn(letter, payload)
        if letter == LETTERS["step"]:
            return b"T", self.player.step(payload)
        if letter == LETTERS["play"]:
            return b"W", self.episodes.play(payload, self.player, self.beat)
        if letter == LETTERS["reset"]:
            return b"T", self.player.reset(struct.unpack("<Q", payload)[0])
        if letter == LETTERS["put"]:
            return b"T", self.player.put(payload)
        if letter == LETTERS["state"]:
            return b"A", self.player.state()
        if letter == LETTERS["view"]:
            return b"V", self.player.view(*struct.unpack("<II", payload))
        asked = json.loads(payload)
        if letter == LETTERS["measure"]:
            return b"K", self.measure(asked)
        if letter == LETTERS["open"]:
            self.player = Player(make(asked), asked.get("own"))
            if asked.get("pictures"):
                follow(self.player.env)
            greeting = self.player.greeting(asked.get("limit"))
            # After the environment, which may bring a MuJoCo of its own.
            self.episodes, greeting["player"] = player_of_episodes()
            return b"G", json.dumps(greeting).encode()
        raise ValueError(f"the request {letter!r} is unknown to a worker of protocol {PROTOCOL}")

    def learn(self, letter, payload):
        if letter == LEARNING["act"]:
            return b"A", self.learner.act(payload)
        if letter == LEARNING["begin"]:
            return b"K", self.learner.begin()
        if letter == LEARNING["train"]:
            return b"K", self.learner.train(struct.unpack("<Q", payload)[0])
        if letter == LEARNING["demonstration"]:
            self.learner.add(payload)
            return b"K", b"null"
        self.learner = Learner(json.loads(payload))
        return b"K", json.dumps({"protocol": PROTOCOL, "versions": self.learner.versions()}).encode()

    def measure(self, asked):
        """Measures these from now on; the answer lists all there are if one of them is missing."""
        known = set(self.player.always)
        self.player.horizon = asked["limit"]
        if not known.issuperset(asked["names"]):
            # Some are there only at the end of an episode.
            known.update(self.player.numbers_in_info(True, asked["limit"]))
        if known.issuperset(asked["names"]):
            self.player.measured = asked["names"]
        return json.dumps(sorted(known)).encode()


def problem(error):
    """An error as its last line says it, with the place in the code."""
    import traceback

    if isinstance(error, Fault):
        return {"kind": "function", "message": str(error), "hint": None, "place": None}
    if isinstance(error, Refused):
        return {"kind": "refused", "message": str(error), "hint": error.hint, "place": None}
    frames = traceback.extract_tb(error.__traceback__)
    theirs = [frame for frame in frames if frame.filename not in ("<string>", __file__ if "__file__" in globals() else "")]
    place = None
    if theirs:
        last = theirs[-1]
        place = f"{os.path.basename(last.filename)}, line {last.lineno}, in {last.name}"
    lines = "".join(traceback.format_exception_only(type(error), error)).strip().splitlines()
    return {"kind": "raised", "message": (lines or [type(error).__name__])[-1], "hint": None, "place": place}


def exactly(stream, count):
    """So many bytes; None where the stream has ended."""
    data = stream.read(count)
    return data if data is not None and len(data) == count else None


def send(descriptor, letter, payload):
    frame = memoryview(struct.pack("<I", len(payload)) + letter + payload)
    while frame:
        frame = frame[os.write(descriptor, frame) :]


def main():
    end_with_parent(int(sys.argv[1]))
    asked, answers = take_streams()
    desk = Desk(lambda: send(answers, b"H", b""))
    while True:
        head = exactly(asked, 5)
        payload = None if head is None else exactly(asked, struct.unpack("<I", head[:4])[0])
        if payload is None:
            break
        try:
            letter, answer = desk.answer(head[4:], payload)
        except BaseException as error:  # Also SystemExit: whatever it is, it is told and not lost.
            letter, answer = b"E", json.dumps(problem(error)).encode()
        sys.stdout.flush()
        send(answers, letter, answer)
    if desk.player is not None and hasattr(desk.player.env, "close"):
        desk.player.env.close()


if __name__ == "__main__":
    main()
