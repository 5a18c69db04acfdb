"""Trainers of a user's own for the point mass, in numpy alone, and ways in which they go wrong."""

import json
import os
import pathlib
import struct
import sys
import time

import numpy

#: A number, and no trainer.
three = 3


def least_squares(demonstrations, seed):
    """The best linear map from observations to actions; each training leaves a line."""
    with open("trainings.log", "a") as log:
        log.write(f"{len(demonstrations)} {seed}\n")
    print("a trainer may print", demonstrations[0])
    observations = numpy.concatenate([one.observations for one in demonstrations])
    actions = numpy.concatenate([one.actions for one in demonstrations])
    assert observations.shape == (len(actions), 4) and actions.shape[1] == 2 and len(demonstrations[0]) == 30
    weights, *_ = numpy.linalg.lstsq(numpy.c_[observations, numpy.ones(len(observations))], actions, rcond=None)
    return lambda observation: numpy.append(observation, 1.0) @ weights


def fails_where_it_is_told_to(demonstrations, seed):
    """After so many trainings as the file `fails` says, until that is taken away."""
    log = pathlib.Path("trainings.log")
    fails = pathlib.Path("fails")
    if fails.exists() and log.exists() and len(log.read_text().splitlines()) >= int(fails.read_text()):
        raise RuntimeError("out of memory of my own")
    return least_squares(demonstrations, seed)


def as_demosift(demonstrations, seed):
    """Learns nothing, and plays a policy of demosift from its file, in numpy."""
    data = pathlib.Path(os.environ["POLICY"]).read_bytes()
    (length,) = struct.unpack_from("<Q", data)
    header, tensors = json.loads(data[8 : 8 + length]), data[8 + length :]

    def tensor(name):
        of = header[f"policy.{name}"]
        return numpy.frombuffer(tensors[slice(*of["data_offsets"])], "<f4").reshape(of["shape"]).astype(float)

    mean, std = tensor("observation_mean"), tensor("observation_std")
    count = sum(name.endswith(".weight") for name in header)
    layers = [(tensor(f"{index}.weight"), tensor(f"{index}.bias")) for index in range(count)]

    def policy(observation):
        flow = numpy.clip((observation - mean) / std, -10.0, 10.0)
        for index, (weight, bias) in enumerate(layers):
            flow = flow @ weight + bias
            flow = numpy.tanh(flow) if index < count - 1 else flow
        return flow

    return policy


class WithHistory:
    """Counts its steps, which a new episode has to set back: it pushes to the goal for 15 of 30 steps, and then back."""

    def __init__(self):
        self.steps = 0

    def reset(self):
        self.steps = 0

    def __call__(self, observation):
        self.steps += 1
        assert self.steps <= 30, "no episode has more"
        return [1.0, 0.0] if self.steps <= 15 else [-1.0, 0.0]


def with_history(demonstrations, seed):
    return WithHistory()


def in_newtons(demonstrations, seed):
    """Sees and acts in the environment's own unit, which is from -2 to 2: each drive of the set begins with all its might."""
    push = max(float(abs(one.actions).max()) for one in demonstrations)
    assert abs(push - 2.0) < 1e-5, push
    return lambda observation: numpy.array([2.0, 0.0])


def of_onnx(demonstrations, seed):
    return pathlib.Path(os.environ["POLICY"])


def returns_nothing(demonstrations, seed):
    pass


def returns_a_number(demonstrations, seed):
    return 3


def returns_no_file(demonstrations, seed):
    return "nowhere.onnx"


def raises(demonstrations, seed):
    raise ValueError("the loss is a fish")


def not_finite(demonstrations, seed):
    return lambda observation: [0.0, float("nan")]


def too_long(demonstrations, seed):
    return lambda observation: numpy.zeros(3)


def dies(demonstrations, seed):
    print("out of luck", file=sys.stderr, flush=True)
    os._exit(7)


def acts_and_dies(demonstrations, seed):
    return lambda observation: os._exit(7)


def hangs(demonstrations, seed):
    pathlib.Path("worker.pid").write_text(str(os.getpid()))
    time.sleep(3600)


def acts_slowly(demonstrations, seed):
    return lambda observation: time.sleep(3600)
