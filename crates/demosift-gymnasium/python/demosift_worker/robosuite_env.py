"""An environment of robosuite, as a set of robomimic names it, as one of Gymnasium.

It observes what the set observes, in the order of its columns, and renders only where it is made to be looked at.
robosuite ignores the seed of a reset by itself, so each reset here gives its generators one of that seed.
It can also be put into a recorded state, from which recorded actions lead where they led when they were recorded.
"""

import difflib
import inspect

import gymnasium
import numpy
from gymnasium import spaces

from demosift_worker.problems import Refused

#: Steps of the episodes by which is seen whether a reset that keeps the model leaves nothing behind.
TRIED = 5
#: What draws at random when an environment is made is the same in every worker.
MAKING = 0
#: Columns and rows of the largest picture that robosuite has room for.
LARGEST = 640, 480
#: From where robomimic looks.
CAMERA = "agentview"
#: What no policy of demosift needs; and the end of an episode is its own matter.
ALWAYS = {
    "has_renderer": False,
    "use_camera_obs": False,
    "use_object_obs": True,
    "ignore_done": True,
}


class Columns(spaces.Tuple):
    """The parts of an observation, with the names that they have in the set."""

    def __init__(self, parts, names):
        super().__init__(parts)
        self.names = names


def make(specified, longest, pictures):
    """The environment; `longest` is the number of steps of the longest episode of the set, where that is known.

    With `pictures` it can be looked at, which needs a graphics library and takes longer.
    """
    try:
        import robosuite
    except ModuleNotFoundError as error:
        if error.name != "robosuite":
            raise
        raise Refused(
            "the set was recorded in robosuite, which is not installed in this interpreter",
            "install robosuite there, or name an interpreter that has it with --python PATH",
        ) from None
    known = sorted(robosuite.ALL_ENVIRONMENTS)
    name = specified["env_name"]
    if name not in known:
        near = difflib.get_close_matches(name, known, 1)
        instead = f"did you mean {near[0]}?" if near else f"it has: {', '.join(known)}"
        raise Refused(
            f"the set names the environment '{name}', and robosuite {robosuite.__version__} has none of that name; {instead}",
            "an environment that another package adds is made by a function of your own: --env my_env.py:make",
        )
    return Robosuite(robosuite, specified, longest, pictures)


class Robosuite(gymnasium.Env):
    """Observes the columns of a set; acts within the bounds of robosuite's own `action_spec`."""

    def __init__(self, robosuite, specified, longest, pictures):
        self.robosuite, self.specified = robosuite, specified
        self.render_mode = "rgb_array" if pictures else None
        self.columns = [
            (one["key"] if one["part"] is None else f"{one['key']}[{one['part'][0]}:{one['part'][1] or ''}]", one)
            for one in specified["observed"]
        ]
        arguments = specified["env_kwargs"]
        self.hard_reset = arguments.get("hard_reset")
        self.build()
        parts = self.look(self.made.reset())
        self.observation_space = Columns(
            [spaces.Box(-numpy.inf, numpy.inf, part.shape, numpy.float64) for part in parts],
            [name for name, _ in self.columns],
        )
        low, high = self.made.action_spec
        self.action_space = spaces.Box(numpy.asarray(low, float), numpy.asarray(high, float), dtype=numpy.float64)
        self.dt = 1.0 / float(self.made.control_freq)
        usual = arguments.get("horizon") or longest
        self.usual_steps = int(usual) if usual else None
        if self.hard_reset is None:
            # To load the model anew takes as long as forty steps.
            self.made.hard_reset = self.hard_reset = not self.repeats()

    def build(self):
        """Makes the environment of robosuite, the same each time."""
        from robosuite.environments.base import REGISTERED_ENVS

        name, arguments = self.specified["env_name"], {**self.specified["env_kwargs"], **ALWAYS}
        arguments["hard_reset"] = bool(self.hard_reset)
        arguments["has_offscreen_renderer"] = self.render_mode is not None
        if "seed" in inspect.signature(REGISTERED_ENVS[name].__init__).parameters:
            arguments["seed"] = MAKING
        numpy.random.seed(MAKING)
        self.made = self.robosuite.make(name, **arguments)
        self.is_put = False

    def repeats(self):
        """Whether the same seed and actions make the same episode again, with another one played between."""
        first, _, again = self.few_steps(1), self.few_steps(2), self.few_steps(1)
        return numpy.array_equal(first, again)

    def few_steps(self, seed):
        action = 0.5 * self.action_space.high
        seen = [self.reset(seed=seed)[0], *(self.step(action)[0] for _ in range(TRIED))]
        return numpy.concatenate([part for parts in seen for part in parts])

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        if self.is_put:
            self.build()
        numpy.random.seed(seed)
        seed_generators(self.made, numpy.random.default_rng(seed))
        return self.look(self.made.reset()), {}

    def step(self, action):
        observed, reward, _, info = self.made.step(action)
        reached = self.made._check_success()
        if isinstance(reached, dict):
            reached = reached["task"]
        return self.look(observed), float(reward), False, False, {**info, "is_success": bool(reached)}

    def look(self, observed):
        return tuple(self.part(observed, **one) for _, one in self.columns)

    def part(self, observed, key, part):
        # robomimic calls all that is seen of objects so.
        theirs = "object-state" if key == "object" and "object" not in observed else key
        if theirs not in observed:
            known = ", ".join(sorted(str(name) for name in observed))
            raise Refused(
                f"the set has the column 'obs/{key}', and the environment makes no observation of that name; it makes: {known}",
                "name the columns that it makes: --observation-columns NAME,NAME",
            )
        numbers = numpy.asarray(observed[theirs], dtype=float).ravel()
        return numbers if part is None else numbers[part[0] : part[1]]

    def put_into(self, model, state):
        """Goes on from a recorded state of this model; the state of a controller is not in it, so only first states are exact."""
        self.is_put = True
        # Observations look at what is loaded now.
        self.made.hard_reset = True
        if model is not None:
            seed_generators(self.made, numpy.random.default_rng(MAKING))
            self.made.reset()
            self.made.reset_from_xml_string(self.made.edit_model_xml(model))
        self.made.sim.reset()
        self.made.sim.set_state_from_flattened(state)
        self.made.sim.forward()
        return self.look(self.made._get_observations(force_update=True))

    def state(self):
        """Time, positions and velocities, as they are recorded."""
        return numpy.asarray(self.made.sim.get_state().flatten(), dtype=float)

    def render_within(self, columns, rows):
        """A picture of at most this size, from the camera that the set names, or else from where robomimic looks."""
        widest, highest = LARGEST
        columns = max(min(columns, rows * widest // highest, widest), 1)
        rows = max(columns * highest // widest, 1)
        seen = self.made.sim.render(width=columns, height=rows, camera_name=self.camera())
        # Graphics libraries count rows from below.
        return numpy.asarray(seen)[::-1]

    def camera(self):
        arguments = self.specified["env_kwargs"]
        named = arguments.get("camera_names") or []
        wanted = [arguments.get("render_camera"), *([named] if isinstance(named, str) else named), CAMERA]
        known = list(self.made.sim.model.camera_names)
        return next((name for name in wanted if name in known), known[0] if known else None)

    def close(self):
        self.made.close()


def seed_generators(made, generator):
    """Makes an environment, and all that places its objects, draw from this generator."""
    made.rng = generator
    samplers = [getattr(made, "placement_initializer", None)]
    while samplers:
        sampler = samplers.pop()
        if sampler is None:
            continue
        sampler.rng = generator
        inner = getattr(sampler, "samplers", None) or {}
        samplers.extend(inner.values() if isinstance(inner, dict) else inner)
