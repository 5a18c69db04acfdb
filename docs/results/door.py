"""AdroitHandDoor-v1 for demosift (`--env docs/results/door.py:make`), and the replay of what people did in it.

    python docs/results/door.py DIR/door_human/door_human.hdf5

plays the recorded actions again from their initial states, and prints how far that leads from what was recorded.
Needs gymnasium-robotics and h5py.
"""

import sys

import gymnasium
import gymnasium_robotics

gymnasium.register_envs(gymnasium_robotics)

#: Where in an observation the angle of the door is, and from which angle on it counts as open, rad.
ANGLE, OPEN = 28, 1.35


def make():
    """The environment with as many steps as the longest demonstration."""
    return gymnasium.make("AdroitHandDoor-v1", max_episode_steps=300)


def replay(path):
    import h5py
    import numpy

    env = make()
    with h5py.File(path) as file:
        observations, actions = file["observations"][:], file["actions"][:]
        ends = numpy.flatnonzero(file["timeouts"][:]) + 1
        states = {name: file["initial_states"][name][:] for name in file["initial_states"]}
    starts = [0, *ends[:-1]]
    apart, opened, recorded = [], 0, 0
    for number, (start, end) in enumerate(zip(starts, ends)):
        state = {name: values[number] for name, values in states.items()}
        env.reset(seed=0, options={"initial_state_dict": state})
        angles = [env.step(numpy.clip(action, -1, 1))[0][ANGLE] for action in actions[start:end]]
        # An observation stands before its action.
        apart.append(numpy.abs(numpy.array(angles[:-1]) - observations[start + 1 : end, ANGLE]).max())
        opened += max(angles) >= OPEN
        recorded += observations[start:end, ANGLE].max() >= OPEN
        print(f"{number:2}  {end - start} steps, the angle of the door at most {apart[-1]:.3f} rad from what was recorded")
    print(f"median {numpy.median(apart):.3f} rad; opened {opened} of {len(ends)}, recorded {recorded}")


if __name__ == "__main__":
    replay(sys.argv[1])
