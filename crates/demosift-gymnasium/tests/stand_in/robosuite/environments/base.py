import types

import numpy

REGISTERED_ENVS = {}
MODEL = '<mujoco mesh="/where/it/was/recorded/hand.stl" mass="{mass!r}"/>'
EDITED = "/where/it/is/played/hand.stl"


def make(env_name, **arguments):
    return REGISTERED_ENVS[env_name](**arguments)


def register(kind):
    REGISTERED_ENVS[kind.__name__] = kind
    return kind


class Sampler:
    """Places the cube; draws from a generator of its own that nobody seeds."""

    def __init__(self, samplers=()):
        self.rng = numpy.random.default_rng()
        self.samplers = {str(number): sampler for number, sampler in enumerate(samplers)}

    def sample(self):
        return [value for one in self.samplers.values() for value in one.sample()] or [self.rng.uniform(0.3, 0.6)]


class State:
    def __init__(self, numbers):
        self.numbers = numbers

    def flatten(self):
        return numpy.array(self.numbers)


class Sim:
    """Time, position and velocity of the hand, position of the cube."""

    def __init__(self, model, is_seen):
        self.mass = float(model.split('mass="')[1].split('"')[0])
        self.model, self.is_seen = types.SimpleNamespace(camera_names=("frontview", "agentview")), is_seen
        self.reset()

    def render(self, width, height, camera_name):
        """Red grows upward, and rows are counted from below; green is where the hand is, blue says which camera looks."""
        assert self.is_seen
        picture = numpy.zeros((height, width, 3), numpy.uint8)
        picture[..., 0] = numpy.linspace(0, 255, height).astype(numpy.uint8)[:, None]
        picture[..., 1] = int(numpy.clip(100 + 100 * self.numbers[1], 0, 255))
        picture[..., 2] = 40 * (1 + self.model.camera_names.index(camera_name))
        return picture

    def reset(self):
        self.numbers = [0.0, 0.0, 0.0, 0.0]
        self.is_forward = False

    def get_state(self):
        return State(self.numbers)

    def set_state_from_flattened(self, numbers):
        if len(numbers) != 4:
            raise ValueError(f"a state has 4 numbers, and not {len(numbers)}")
        self.numbers, self.is_forward = [float(number) for number in numbers], False

    def forward(self):
        self.is_forward = True


@register
class Push:
    def __init__(
        self,
        robots,
        control_freq=20,
        horizon=1000,
        ignore_done=False,
        hard_reset=True,
        has_renderer=False,
        has_offscreen_renderer=True,
        use_camera_obs=True,
        use_object_obs=True,
        camera_names="agentview",
        seed=None,
    ):
        if has_renderer or use_camera_obs:
            raise RuntimeError("there are no windows here, and no cameras to observe by")
        self.is_seen = has_offscreen_renderer
        self.control_freq, self.horizon, self.ignore_done = control_freq, horizon, ignore_done
        self.hard_reset, self.deterministic_reset = hard_reset, False
        self.action_spec = numpy.array([-2.0, -1.0]), numpy.array([2.0, 1.0])
        self.rng = numpy.random.default_rng(seed)
        self.placement_initializer = Sampler([Sampler()])
        self.load()
        self.begin()

    def load(self, model=None):
        self.model = model or MODEL.format(mass=self.rng.uniform(1.0, 2.0))
        self.sim = Sim(self.model, self.is_seen)

    def reset(self):
        if self.hard_reset and not self.deterministic_reset:
            self.load()
        else:
            self.clean()
        self.begin()
        return self._get_observations(force_update=True)

    def clean(self):
        self.sim.reset()

    def begin(self):
        self.timestep, self.done, self.remembered, self.cached = 0, False, 0.0, None
        if not self.deterministic_reset:
            self.sim.numbers[1] += 0.02 * self.rng.standard_normal()
            self.sim.numbers[3] = self.placement_initializer.sample()[0]
        self.sim.forward()

    def edit_model_xml(self, text):
        return text.replace("/where/it/was/recorded/hand.stl", EDITED)

    def reset_from_xml_string(self, text):
        if EDITED not in text:
            raise RuntimeError("a mesh is not where the model says")
        self.deterministic_reset = True
        self.load(text)
        self.reset()
        self.deterministic_reset = False

    def step(self, action):
        if self.done:
            raise ValueError("executing action in terminated episode")
        self.timestep += 1
        time, hand, velocity, cube = self.sim.numbers
        # The controller moves its goal slowly.
        self.remembered += 0.5 * (float(action[0]) - self.remembered)
        velocity += (self.remembered - velocity) / (self.sim.mass * self.control_freq)
        hand += velocity / self.control_freq
        cube = max(cube, hand)
        self.sim.numbers = [time + 1.0 / self.control_freq, hand, velocity, cube]
        self.done = self.timestep >= self.horizon and not self.ignore_done
        return self._get_observations(force_update=True), cube, self.done, {}

    def _get_observations(self, force_update=False):
        if not self.sim.is_forward:
            raise RuntimeError("positions are looked at before they are known")
        if force_update or self.cached is None:
            _, hand, velocity, cube = self.sim.numbers
            self.cached = {
                "robot0_eef_pos": numpy.array([hand, velocity]),
                "cube_pos": numpy.array([cube]),
                "object-state": numpy.array([cube, cube - hand, 1.0]),
            }
        return self.cached

    def _check_success(self):
        return self.sim.numbers[3] > 1.0

    def close(self):
        pass


@register
class Sticky(Push):
    """A reset that keeps the model leaves the velocity as it was."""

    def clean(self):
        velocity = self.sim.numbers[2]
        super().clean()
        self.sim.numbers[2] = velocity

    def _check_success(self):
        return {"task": super()._check_success(), "grasp": False}
