"""Writes walker2d.json: what Gymnasium's Walker2d-v5 does from fixed states under fixed actions.

    pip install gymnasium==1.4.0 mujoco==3.17.0 imageio packaging
    python walker2d.py

Every number is written so that it reads back to the same f64. Actions are f32, as the environments take them; every fifth one
exceeds [-1, 1], so that MuJoCo clips it. Each episode goes on to the step that Gymnasium ends it with.
"""

import json
import pathlib

import gymnasium
import mujoco
import numpy as np

LONGEST = 150

assert mujoco.__version__ == "3.17.0", mujoco.__version__
environment = gymnasium.make("Walker2d-v5", disable_env_checker=True).unwrapped
model, data = environment.model, environment.data
rng = np.random.default_rng(21)


def episode(scale, **velocities):
    """One episode of actions of this size; `velocities` replace those of the start, by their number."""
    qpos = environment.init_qpos + rng.uniform(-0.005, 0.005, model.nq)
    qvel = environment.init_qvel + rng.uniform(-0.005, 0.005, model.nv)
    for at, velocity in velocities.items():
        qvel[int(at[1:])] = velocity
    environment.reset(seed=0)
    # As after any reset: without the warm start that the reset's own random state left behind.
    mujoco.mj_resetData(model, data)
    environment.set_state(qpos, qvel)
    steps = []
    while True:
        action = rng.uniform(-scale, scale, model.nu) * (1.6 if len(steps) % 5 == 0 else 1.0)
        action = action.astype(np.float32).astype(np.float64)
        observation, reward, terminated, truncated, _ = environment.step(action)
        assert not truncated
        steps.append(
            {
                "action": action.tolist(),
                "qpos": data.qpos.tolist(),
                "qvel": data.qvel.tolist(),
                "observation": observation.tolist(),
                "reward": float(reward),
                "terminated": bool(terminated),
            }
        )
        if terminated:
            return {"qpos": qpos.tolist(), "qvel": qvel.tolist(), "steps": steps}
        assert len(steps) < LONGEST


# It leans too far backward, leaps too high, sinks, and turns over forward in a leap.
episodes = [
    episode(1.0),
    episode(0.8, v1=7.0),
    episode(0.2, v2=4.0),
    episode(0.2, v1=3.0, v2=8.0),
]
last = [one["steps"][-1]["qpos"] for one in episodes]
assert last[0][2] < -1.0 and last[1][1] > 2.0 and last[2][1] < 0.8 and last[3][2] > 1.0, last
assert any(abs(v) > 10.0 for one in episodes for step in one["steps"] for v in step["qvel"])

path = pathlib.Path(__file__).with_suffix(".json")
with path.open("w") as file:
    file.write(f'{{\n"gymnasium": {json.dumps(gymnasium.__version__)},\n"mujoco": {json.dumps(mujoco.__version__)},\n')
    file.write('"episodes": [\n')
    for number, one in enumerate(episodes):
        file.write(f'{{"qpos": {json.dumps(one["qpos"])},\n"qvel": {json.dumps(one["qvel"])},\n"steps": [\n')
        file.write(",\n".join(json.dumps(step) for step in one["steps"]))
        file.write("\n]}" + (",\n" if number + 1 < len(episodes) else "\n"))
    file.write("]}\n")
print(f"{path.name}: episodes of {', '.join(str(len(one['steps'])) for one in episodes)} steps")
