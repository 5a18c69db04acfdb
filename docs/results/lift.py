"""Records eight demonstrations of robosuite's task Lift, as a set of robomimic.

Three lift the cube well and two with noise, two reach beside it, and one grasps it without lifting.

    python docs/results/lift.py lift.hdf5

Needs robosuite and h5py.
Each episode begins as robosuite's own `DataCollectionWrapper` begins it: from its model and its state anew, so that its actions
can be played again from there.
"""

import json
import sys

import h5py
import numpy
import robosuite

ENVIRONMENT = {
    "robots": ["Panda"],
    "control_freq": 20,
    "reward_shaping": True,
    "has_renderer": False,
    "has_offscreen_renderer": False,
    "use_camera_obs": False,
    "use_object_obs": True,
    "ignore_done": True,
}
OBSERVED = {"object": "object-state", **{name: name for name in ("robot0_eef_pos", "robot0_eef_quat", "robot0_gripper_qpos")}}
STEPS = 80
#: How far beside the cube it reaches, m; the standard deviation of the noise of its actions; whether it lifts.
GOOD = {"beside": 0.0, "noise": 0.0, "lifts": True}
NOISY = {**GOOD, "noise": 0.6}
MISSES = {**GOOD, "beside": 0.08}
STAYS = {**GOOD, "lifts": False}
QUALITIES = [GOOD, MISSES, NOISY, GOOD, STAYS, MISSES, GOOD, NOISY]


def policy(observed, step, quality, random):
    """Above the cube, down to it, close, lift; an action of changes of position, of rotation, and the gripper's."""
    wanted = observed["cube_pos"] + [quality["beside"], 0.0, 0.08 if step < 20 else 0.0]
    if step >= 40 and quality["lifts"]:
        wanted = numpy.array([*observed["robot0_eef_pos"][:2], 1.05])
    # A change of 1 is 0.05 m.
    move = (wanted - observed["robot0_eef_pos"]) / 0.05
    action = numpy.concatenate([move, numpy.zeros(3), [-1.0 if step < 32 else 1.0]])
    action[:6] += quality["noise"] * random.standard_normal(6) * [1, 1, 1, 0.3, 0.3, 0.3]
    return numpy.clip(action, -1.0, 1.0)


def record(seed, quality):
    env = robosuite.make("Lift", seed=seed, **ENVIRONMENT)
    random = numpy.random.default_rng(seed)
    env.reset()
    model, state = env.sim.model.get_xml(), env.sim.get_state().flatten()
    env.reset_from_xml_string(model)
    env.sim.reset()
    env.sim.set_state_from_flattened(state)
    env.sim.forward()
    observed = env._get_observations(force_update=True)
    found = {"states": [], "actions": [], "rewards": [], **{f"obs/{name}": [] for name in OBSERVED}}
    for step in range(STEPS):
        action = policy(observed, step, quality, random)
        found["states"].append(env.sim.get_state().flatten())
        found["actions"].append(action)
        for name, theirs in OBSERVED.items():
            found[f"obs/{name}"].append(observed[theirs])
        observed, reward, _, _ = env.step(action)
        found["rewards"].append(reward)
    lifted = bool(env._check_success())
    env.close()
    return model, {name: numpy.array(rows, dtype=float) for name, rows in found.items()}, lifted


def main(path):
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        for number, quality in enumerate(QUALITIES):
            model, found, lifted = record(number, quality)
            print(f"demo_{number}: {quality}, lifted: {lifted}, rewards {found['rewards'].sum():.1f}")
            group = data.create_group(f"demo_{number}")
            group.attrs["model_file"], group.attrs["num_samples"] = model, STEPS
            for name, rows in found.items():
                group.create_dataset(name, data=rows)
        data.attrs["total"] = STEPS * len(QUALITIES)
        data.attrs["env_args"] = json.dumps(
            {"env_name": "Lift", "env_version": robosuite.__version__, "type": 1, "env_kwargs": ENVIRONMENT}
        )


if __name__ == "__main__":
    main(sys.argv[1])
