"""A trainer of the user's own, and the policy that it makes."""

import json
import os
import struct
import sys

from demosift_worker.naming import named, versions_of
from demosift_worker.problems import Refused


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
