"""What the adapted behaviors distance (Table 1) comes to without any imitation, on the sets of the sports.

python docs/results/adapted_behaviors.py        prints the table of docs/paper.md, reading 11

Needs numpy and h5py. The distance is that of the paper and of crates/demosift/src/world/adapted_behaviors.rs, in raw units between
the pairs of the same time step, and each row is its mean over the demonstrations of a set.
"""

from pathlib import Path

import h5py
import numpy as np

SETS = ["free_throw_8", "free_throw_20", "penalty_save_12", "handstand_15", "martial_arts_10"]


def episodes(name):
    """Observations and actions of each demonstration, `[T, obs]` and `[T, act]`."""
    (file,) = (Path(__file__).parents[2] / "data" / name).glob("*.hdf5")
    with h5py.File(file) as data:
        observations, actions = data["observations"][:], data["actions"][:]
        ends = np.flatnonzero(data["terminals"][:].astype(bool) | data["timeouts"][:].astype(bool)) + 1
    starts = np.concatenate([[0], ends[:-1]])
    return [(observations[start:end], actions[start:end]) for start, end in zip(starts, ends)]


def distance(shown, acted):
    """Mean over the steps that both have, of the distance of observations plus that of actions."""
    steps = min(len(shown[0]), len(acted[0]))
    return sum(np.linalg.norm(one[:steps] - other[:steps], axis=1).mean() for one, other in zip(shown, acted))


def still(shown):
    """It stays as it is at the first step, without velocity as far as that is, and does nothing."""
    observations, actions = shown
    return np.repeat(observations[:1], len(observations), axis=0), np.zeros_like(actions)


def row(name):
    shown = episodes(name)
    pairs = [(one, other) for place, one in enumerate(shown) for other in shown[place + 1 :]]
    found = [
        np.mean([distance(one, still(one)) for one in shown]),
        np.mean([distance(one, other) for one, other in pairs]),
        np.mean([distance((one[0][1:], one[1][1:]), one) for one in shown]),
    ]
    return f"| {name} | " + " | ".join(f"{value:.1f}" for value in found) + " |"


if __name__ == "__main__":
    print("| set | an agent that keeps still | another demonstration | the same, one step later |")
    print("|---|---|---|---|")
    for name in SETS:
        print(row(name))
