"""Plays an environment, a step at a time."""

import math
import struct
from collections.abc import Mapping

from demosift_worker.environment import limit_of, picture_secs, step_secs, versions
from demosift_worker.own import ALWAYS, SCORE, Measure, Score, as_number
from demosift_worker.problems import OLD_API, Refused, Returned
from demosift_worker.spaces import action_bounds, flattener, leaves

TERMINATED, TRUNCATED = 1, 2
#: Flags and reward stand before the observation of a turn.
TURN_HEAD = struct.Struct("<Bd")
#: What Gymnasium's methods return.
RESET, STEP = ("observation", "info"), ("observation", "reward", "terminated", "truncated", "info")
FLOAT = "let step() return a float as its second value"
FINITE = "let it end an episode as terminated before its numbers run away, or give a number in place of what is not known"


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
        count = getattr(env, "num_envs", 1)
        if isinstance(count, int) and count > 1:
            raise Refused(
                f"what was made is a vector of {count} environments, and one is wanted",
                "return one of them; demosift starts as many processes as --workers says",
            )
        self.bounds = action_bounds(env.action_space)
        self.parts = []
        for name, space, way in leaves(env.observation_space):
            numbers, width = flattener(name, space, way)
            self.parts.append((name, way, numbers, width))
        self.shape, self.dtype = env.action_space.shape, env.action_space.dtype
        self.doubles = numpy.dtype("<f8")
        #: Numbers of info that are there after every step, those that were seen at all, and those that are measured.
        self.always, self.known, self.measured = set(), set(), []
        self.steps = 0
        self.width = sum(width for _, _, _, width in self.parts)

    def reset(self, seed):
        import random

        # For environments that draw from these and not from their own generator.
        random.seed(seed)
        self.numpy.random.seed(seed % 2**32)
        observation, _ = several(self.env.reset(seed=seed), "reset", RESET)
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
        observation, reward, terminated, truncated, info = several(self.env.step(action), "step", STEP)
        self.steps += 1
        reward, terminated, truncated = self.rewarded(reward), bool(terminated), bool(truncated)
        if not isinstance(info, Mapping):
            raise Returned(f"an info of type {type(info).__name__} {self.when()}; wanted a dict", OLD_API)
        if self.own is not None:
            info = {**info, **self.own.numbers(self.env, self.steps, observation, reward, info)}
        if self.score is not None:
            # An environment may write into what it was given and has returned.
            self.score.add(self.flat(observation).copy(), self.numpy.array(action, dtype=float).ravel(), reward)
            is_over = terminated or truncated or self.steps == self.horizon
            info = {**info, SCORE: self.score.number_of_episode() if is_over else 0.0}
        return observation, reward, terminated, truncated, info

    def rewarded(self, reward):
        """The reward of a step, if it is a finite number."""
        try:
            number = float(reward)
        except (TypeError, ValueError):
            of_shape = f" of shape {reward.shape}" if hasattr(reward, "shape") else ""
            kind = type(reward).__name__
            raise Returned(f"a reward of type {kind}{of_shape} {self.when()}; wanted a number", FLOAT) from None
        if not math.isfinite(number):
            raise Returned(f"the reward {number} {self.when()}; wanted a finite number", FINITE)
        return number

    def when(self):
        return f"after step {self.steps}" if self.steps else "after a reset"

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
        if number is not None and not math.isfinite(number):
            raise Returned(f"{number} as '{name}' in info {self.when()}; wanted a finite number", FINITE)
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
            # One product tells of all numbers; squares may overflow where no number has.
            if not math.isfinite(part.dot(part)) and not self.numpy.isfinite(part).all():
                raise self.not_finite(name, part)
            parts.append(part)
        return parts[0] if len(parts) == 1 else self.numpy.concatenate(parts)

    def not_finite(self, name, part):
        number = int(self.numpy.flatnonzero(~self.numpy.isfinite(part))[0])
        where = f"number {number} of the observation" if len(self.parts) == 1 else f"number {number} of the observation's '{name}'"
        return Returned(f"{part[number]} as {where} {self.when()}; wanted finite numbers", FINITE)

    def numbers_in_info(self, whole_episode, limit, beat=None):
        """Names of the numbers in info after one step, or after any step of an episode, which `beat` is told of each time."""
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
            if beat is not None:
                beat()
            found.extend(name for name in names if name not in found)
            if not whole_episode or terminated or truncated or seen == limit:
                self.known.update(found)
                return sorted(found)

    def sizes(self):
        """Numbers in an observation, and numbers of info that are measured."""
        return self.width, len(self.measured)

    def greeting(self, limit):
        info = self.numbers_in_info(False, 1)
        inner = getattr(self.env, "unwrapped", self.env)
        return {
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


def several(returned, method, wanted):
    """What `reset` or `step` returned, if it is as much as Gymnasium has it."""
    if isinstance(returned, (tuple, list)) and len(returned) == len(wanted):
        return returned
    found = f"{len(returned)} values" if isinstance(returned, (tuple, list)) else f"an object of type {type(returned).__name__}"
    raise Returned(f"{found} from {method}(); wanted the {len(wanted)} of Gymnasium: {', '.join(wanted)}", OLD_API)
