"""Records episodes of Pendulum-v1 with their seeds into a folder: what a test makes a set of Minari of."""

import json
import os
import sys

import gymnasium
import numpy

folder = sys.argv[1]
os.makedirs(folder)
env = gymnasium.make("Pendulum-v1")
episodes = []
# Minari draws seeds of 64 bits.
for number, seed in enumerate([3, 2**63 + 5, 7]):
    observation, _ = env.reset(seed=seed)
    rng = numpy.random.default_rng(number)
    observations, actions = [observation], []
    for step in range(200):
        action = rng.uniform(-2, 2, 1).astype(numpy.float32)
        observation, _, _, _, _ = env.step(action)
        observations.append(observation)
        actions.append(action)
    flat = lambda rows: [float(number) for row in rows for number in row]
    episodes.append({"seed": seed, "observations": flat(observations), "actions": flat(actions)})
with open(os.path.join(folder, "episodes.json"), "w") as file:
    json.dump(episodes, file)
with open(os.path.join(folder, "spec.json"), "w") as file:
    file.write(env.spec.to_json())
