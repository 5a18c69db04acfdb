"""Behavioral cloning of imitation 1.0.1 as a trainer of demosift's referee.

demosift sift half_cheetah_noisy.hdf5 --task half_cheetah --preset quick --judge cloning \\
    --trainer docs/results/imitation_trainer.py:train --python .venv/bin/python --referee cloning=10,gail=0,trainer=10

Needs imitation 1.0.1 in that interpreter.
"""

import gymnasium
import numpy
import torch
from imitation.algorithms import bc
from imitation.data.types import Transitions

BATCH = 32
# As many as demosift's own cloning takes.
BATCHES = 2000


def train(demonstrations, seed):
    torch.set_num_threads(1)
    observations = numpy.concatenate([one.observations[:-1] for one in demonstrations])
    following = numpy.concatenate([one.observations[1:] for one in demonstrations])
    actions = numpy.concatenate([one.actions[:-1] for one in demonstrations]).clip(-1, 1)
    unbounded = numpy.full(observations.shape[1], numpy.inf, dtype=numpy.float32)
    bounds = numpy.ones(actions.shape[1], dtype=numpy.float32)
    learner = bc.BC(
        observation_space=gymnasium.spaces.Box(-unbounded, unbounded),
        action_space=gymnasium.spaces.Box(-bounds, bounds),
        demonstrations=Transitions(
            obs=observations,
            acts=actions,
            infos=numpy.array([{}] * len(actions)),
            next_obs=following,
            dones=numpy.zeros(len(actions), dtype=bool),
        ),
        batch_size=BATCH,
        rng=numpy.random.default_rng(seed),
    )
    learner.train(n_batches=BATCHES, progress_bar=False, log_interval=10**9)
    return lambda observation: learner.policy.predict(observation, deterministic=True)[0]
