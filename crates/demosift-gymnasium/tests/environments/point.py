"""A point mass as demosift's own, in numpy, and ways in which environments go wrong."""

import argparse
import os
import signal
import subprocess
import sys
import time

import gymnasium
import numpy
from gymnasium import spaces

STEP = numpy.float32(0.1)
FRICTION = numpy.float32(1.0)
GOAL = numpy.array([1.0, 0.0], dtype=numpy.float32)


class Point(gymnasium.Env):
    """Observed are position and velocity; the action is a force of at most 2 m/s² along each axis."""

    spread = numpy.float32(0.05)
    metadata = {"render_fps": 10}

    def __init__(self, at_step=None):
        self.observation_space = spaces.Box(-numpy.inf, numpy.inf, (4,), numpy.float32)
        self.action_space = spaces.Box(-2.0, 2.0, (2,), numpy.float32)
        self.at_step = at_step
        self.steps = 0

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.position = self.spread * self.np_random.standard_normal(2, dtype=numpy.float32)
        self.velocity = numpy.zeros(2, dtype=numpy.float32)
        self.steps = 0
        return self.look(), {}

    def step(self, action):
        self.steps += 1
        if self.at_step is not None:
            self.at_step(self)
        before = self.distance()
        self.velocity = self.velocity + (action - FRICTION * self.velocity) * STEP
        self.position = self.position + self.velocity * STEP
        after = self.distance()
        info = {"distance": after, "is_success": bool(after < 0.25), "name": "point"}
        return self.look(), before - after, False, False, info

    def distance(self):
        offset = self.position - GOAL
        return float(numpy.hypot(offset[0], offset[1]))

    def look(self):
        return numpy.concatenate([self.position, self.velocity])


class Drawn(Point):
    """Draws where it is, a red square on white paper of 160 x 120 pixels."""

    def __init__(self, render_mode=None):
        super().__init__()
        self.render_mode = render_mode

    def render(self):
        picture = numpy.full((120, 160, 3), 255, dtype=numpy.uint8)
        column, row = int(80 + 40 * self.position[0]), int(60 - 40 * self.position[1])
        picture[max(row - 4, 0) : max(row + 4, 0), max(column - 4, 0) : max(column + 4, 0)] = (200, 0, 0)
        return picture


class Still(Point):
    """Starts at the origin, whatever the seed."""

    spread = numpy.float32(0.0)


def make():
    return Point()


def limited():
    return gymnasium.wrappers.TimeLimit(Point(), 30)


def reads_its_arguments():
    argparse.ArgumentParser().parse_args()
    return Point()


def drawn(render_mode=None):
    return gymnasium.wrappers.TimeLimit(Drawn(render_mode), 30)


def draws_nothing(render_mode=None):
    point = Drawn(render_mode)
    point.render = lambda: None
    return point


def raises():
    def at_step(point):
        if point.steps == 5:
            raise RuntimeError("the arm is gone")

    return Point(at_step)


def raises_late():
    """Not in the few steps by which it is tried."""

    def at_step(point):
        if point.steps == 25:
            raise RuntimeError("the arm is gone")

    return Point(at_step)


def hangs():
    return Point(lambda point: time.sleep(1000) if point.steps == 25 else None)


def says_who_it_is(file, process):
    """Writes the number of a process into a file, which is there when it is whole."""
    with open(f"{file}.partial", "w") as partial:
        partial.write(str(process))
    os.rename(f"{file}.partial", file)


def hangs_and_says_who_it_is():
    def at_step(point):
        if point.steps == 25:
            says_who_it_is("worker.pid", os.getpid())
            time.sleep(1000)

    return Point(at_step)


def hangs_beside_its_server():
    """Starts a process that has nothing of it open, as a simulator with a server does."""

    def at_step(point):
        if point.steps == 25:
            server = subprocess.Popen(["sleep", "1000"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            says_who_it_is("server.pid", server.pid)
            time.sleep(1000)

    return Point(at_step)


def kills_itself():
    def at_step(point):
        if point.steps == 25:
            print("out of luck", file=sys.stderr, flush=True)
            os.kill(os.getpid(), signal.SIGKILL)

    return Point(at_step)


def kills_itself_beside_a_child():
    """Leaves a child that has all that it had open, and waits."""

    def at_step(point):
        if point.steps == 25:
            if os.fork() == 0:
                time.sleep(1000)
                os._exit(0)
            os.kill(os.getpid(), signal.SIGKILL)

    return Point(at_step)


def forks():
    """Has children that end as a program does, with other files open, and one that goes on as if it were the worker."""

    def at_step(point):
        if point.steps not in (5, 25):
            return
        for ends in (True, False):
            child = os.fork()
            if child == 0:
                opened = [open(os.devnull, "w") for _ in range(4)]
                if os.fork() == 0:
                    # The child of the child has them still.
                    [one.close() for one in opened]
                    os._exit(0)
                assert os.wait()[1] == 0
                if ends:
                    sys.exit(0)
                return
            assert os.waitpid(child, 0)[1] == 0

    return Still(at_step)


def exits():
    return Point(lambda point: sys.exit(3) if point.steps == 25 else None)


def prints():
    def at_step(point):
        print("hello from Python")
        os.write(1, b"hello from the system\n")
        subprocess.run(["echo", "hello from a child"], check=True)

    return Still(at_step)


def ignores_its_seed():
    point = Point()
    point.reset, reset = lambda seed=None, options=None: reset(seed=int.from_bytes(os.urandom(4), "big")), point.reset
    return point


def drifts():
    """Starts as the seed says, and is pushed about as it likes."""

    def at_step(point):
        point.velocity = point.velocity + numpy.frombuffer(os.urandom(2), dtype=numpy.uint8).astype(numpy.float32) / 2550

    return Point(at_step)


def sleeps():
    return gymnasium.wrappers.TimeLimit(Point(lambda point: time.sleep(0.005)), 30)


class ResetsSlowly(Point):
    """Needs a fifth of a second to begin an episode, and next to nothing to go on with it."""

    def reset(self, seed=None, options=None):
        time.sleep(0.2)
        return super().reset(seed=seed)


class Ends(Point):
    """Is terminal after 3 steps if its first seed is odd, and truncated after 4 if not."""

    def reset(self, seed=None, options=None):
        self.odd = seed % 2 == 1
        return super().reset(seed=seed)

    def step(self, action):
        observation, reward, _, _, info = super().step(action)
        terminated, truncated = self.odd and self.steps == 3, self.steps == 4
        if terminated or truncated:
            info["late"] = self.steps
        return observation, reward, terminated, truncated, info


class NotANumber(Point):
    def step(self, action):
        observation, reward, terminated, truncated, info = super().step(action)
        return observation, reward, terminated, truncated, {**info, "bad": float("nan") if self.steps == 25 else 1.0}


def loses(what, value, step=5):
    """Of a step it returns this in place of what belongs there."""
    point = Point()
    works = point.step

    def returned(action):
        observation, reward, terminated, truncated, info = works(action)
        if point.steps == step and what == "observation":
            observation[2] = value
        if point.steps == step and what == "reward":
            reward = value
        return observation, reward, terminated, truncated, info

    point.step = returned
    return point


def loses_sight():
    return loses("observation", numpy.nan)


def loses_sight_late():
    """Not in the few steps by which it is tried."""
    return loses("observation", numpy.inf, 25)


def loses_its_reward():
    return loses("reward", numpy.nan)


def has_no_reward():
    return loses("reward", None, 1)


def has_two_rewards():
    return loses("reward", numpy.zeros(2), 1)


class OldStep(Point):
    """Steps as the old API of Gym did."""

    def step(self, action):
        observation, reward, terminated, _, info = super().step(action)
        return observation, reward, terminated, info


class OldReset(Point):
    def reset(self, seed=None, options=None):
        return super().reset(seed=seed)[0]


class TakesNoSeed(Point):
    def reset(self):
        return super().reset()


def old_within_a_limit():
    return gymnasium.wrappers.TimeLimit(OldStep(), 30)


def of_gym(space):
    """A space as the old gym has it: of the same name, in a module of its own."""
    return type(type(space).__name__, (), {"__module__": "gym.spaces", **vars(space)})()


def acts_in_gym():
    return with_action(of_gym(spaces.Box(-2.0, 2.0, (2,))))


def observes_in_gym():
    point = Point()
    point.observation_space = spaces.Dict(joints=point.observation_space)
    point.observation_space.spaces["joints"] = of_gym(point.observation_space["joints"])
    return point


def several():
    return gymnasium.vector.SyncVectorEnv([Point, Point])


class TellsAtTheEnd(Point):
    """Says of success in the last step of an episode alone."""

    def step(self, action):
        observation, reward, terminated, truncated, _ = super().step(action)
        return observation, reward, terminated, truncated, {"success": self.distance() > 0.25} if self.steps == 30 else {}


class Exact(Point):
    """Observes twice what 32 bits leave out of its action, times 2^25."""

    def __init__(self):
        super().__init__()
        self.action_space = spaces.Box(-2.0, 2.0, (2,), numpy.float64)

    def reset(self, seed=None, options=None):
        self.left_out = numpy.zeros(2)
        return super().reset(seed=seed)

    def step(self, action):
        self.left_out = (action - action.astype(numpy.float32)) * 2.0**25
        return super().step(action)

    def look(self):
        return numpy.concatenate([self.left_out, self.left_out]).astype(numpy.float32)


class Nested(Point):
    """Observes a dictionary, whose order is that of its names."""

    def __init__(self):
        super().__init__()
        inner = spaces.Tuple((spaces.Box(-1, 1, (1,)), spaces.Discrete(3)))
        self.observation_space = spaces.Dict([("b", spaces.Box(-9, 9, (2,), numpy.float64)), ("a", inner)])

    def look(self):
        return {"b": self.position.astype(float) + 7, "a": (numpy.array([0.5]), 2)}


def with_action(space):
    point = Point()
    point.action_space = space
    return point


def narrow():
    return with_action(spaces.Box(-1.0, 1.0, (1,)))


def uneven():
    return with_action(spaces.Box(numpy.array([0.0, -3.0]), numpy.array([255.0, 7.0]), dtype=numpy.float64))


def discrete():
    return with_action(spaces.Discrete(4))


def unbounded():
    return with_action(spaces.Box(-numpy.inf, numpy.inf, (2,)))


def whole_numbers():
    return with_action(spaces.Box(0, 3, (2,), numpy.int64))


def pictures():
    point = Point()
    point.observation_space = spaces.Dict(camera=spaces.Box(0, 255, (64, 64, 3), numpy.uint8))
    return point


def no_environment():
    return 3


def broken_at_length():
    raise RuntimeError("the arm is out of memory\nask its vendor\nor compile with care\n")


def broken():
    return undefined_name  # noqa: F821


def measure(env, obs, reward, info):
    """The distance again, out of the environment, and what of it the observation says."""
    offset = obs[:2] - GOAL
    return {"gap": env.unwrapped.distance(), "offset": numpy.hypot(offset[0], offset[1]), "paid": reward}


def nearest(observations, actions, rewards):
    """How near an episode came to the goal; less than 0."""
    assert observations.shape == (len(actions) + 1, 4) and actions.shape[1] == 2 and len(rewards) == len(actions)
    assert numpy.abs(actions).max() <= 2.0
    offsets = observations[1:, :2] - GOAL
    observations[:] = 0.0  # What it is given is its own.
    return -numpy.hypot(offsets[:, 0], offsets[:, 1]).min()


def measure_raises(env, obs, reward, info):
    return {"gap": 1.0 / (env.unwrapped.steps - 3)}


def measure_list(env, obs, reward, info):
    return [1.0]


def measure_nan(env, obs, reward, info):
    return {"gap": float("nan")}


def measure_word(env, obs, reward, info):
    return {"gap": "near"}


def measure_other(env, obs, reward, info):
    return {"gap": 1.0} if env.unwrapped.steps < 5 else {"gap": 1.0, "late": 2.0}


def measure_taken(env, obs, reward, info):
    return {"distance": 1.0}


def measure_nothing(env, obs, reward, info):
    return {}


measure_number = 3


def score_raises(observations, actions, rewards):
    raise ValueError("no such episode")


def score_nan(observations, actions, rewards):
    return float("inf")


def score_none(observations, actions, rewards):
    return None
