"""What the adapted behaviors distance (Table 1) comes to without any imitation, on the sets of the sports.

python docs/results/adapted_behaviors.py        prints the table of docs/paper.md, reading 11

Needs numpy and h5py. The distance is that of the paper and of crates/demosift/src/world/adapted_behaviors.rs, in raw units between
the pairs of the same time step, and each row is its mean over the demonstrations of a set.
"""

from pathlib import Path

import h5py
import numpy as np

SETS = ["free_throw_8", "free_throw_20", "penalty_save_12", "handstand_15", "martial_arts_10"]
# The columns of Penalty Save that hold contact wrenches, by the order in its task.toml.
WRENCHES = {"penalty_save_12": range(42, 90)}


def file_of(name):
    (file,) = (Path(__file__).parents[2] / "data" / name).glob("*.hdf5")
    return file


def shares(name):
    """Of the variance of the observations, summed over columns, the shares of velocities and of contact wrenches."""
    with h5py.File(file_of(name)) as data:
        observations, speeds = data["observations"][:], data["infos/qvel"][:]
    variances = observations.var(axis=0)
    is_speed = [any(np.allclose(column, speed, atol=1e-6) for speed in speeds.T) for column in observations.T]
    found = [variances[is_speed].sum(), variances[list(WRENCHES.get(name, []))].sum()]
    return [share / variances.sum() for share in found]


def episodes(name):
    """Observations and actions of each demonstration, `[T, obs]` and `[T, act]`."""
    with h5py.File(file_of(name)) as data:
        observations, actions = data["observations"][:], data["actions"][:]
        ends = np.flatnonzero(data["terminals"][:].astype(bool) | data["timeouts"][:].astype(bool)) + 1
    starts = np.concatenate([[0], ends[:-1]])
    return [(observations[start:end], actions[start:end]) for start, end in zip(starts, ends)]


def distance(shown, acted):
    """Mean over the steps that both have, of the distance of observations plus that of actions."""
    steps = min(len(shown[0]), len(acted[0]))
    return sum(np.linalg.norm(one[:steps] - other[:steps], axis=1).mean() for one, other in zip(shown, acted))


def still(shown):
    """The first observation at all steps, and no action."""
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
    cells = [f"{value:.1f}" for value in found] + [f"{share:.0%}" for share in shares(name)]
    return f"| {name} | " + " | ".join(cells) + " |"


if __name__ == "__main__":
    print("| set | an agent that keeps still | another demonstration | the same, one step later | of velocities | of contacts |")
    print("|---|---|---|---|---|---|")
    for name in SETS:
        print(row(name))
