"""Writes half_cheetah.json: what Gymnasium's HalfCheetah-v5 does from a fixed state under fixed actions.

    pip install gymnasium==1.4.0 mujoco==3.17.0 imageio packaging
    python half_cheetah.py

Every number is written so that it reads back to the same f64. Actions are f32, as the environments take them; every fifth one
exceeds [-1, 1], so that MuJoCo clips it.
"""

import json
import pathlib

import gymnasium
import mujoco
import numpy as np

STEPS = 200

assert mujoco.__version__ == "3.17.0", mujoco.__version__
environment = gymnasium.make("HalfCheetah-v5", disable_env_checker=True).unwrapped
model, data = environment.model, environment.data
rng = np.random.default_rng(20)

qpos = environment.init_qpos + rng.uniform(-0.1, 0.1, model.nq)
qvel = environment.init_qvel + 0.1 * rng.standard_normal(model.nv)
environment.reset(seed=0)
# As after any reset: without the warm start that the reset's own random state left behind.
mujoco.mj_resetData(model, data)
environment.set_state(qpos, qvel)

steps, touching = [], 0
for step in range(STEPS):
    action = rng.uniform(-1.0, 1.0, model.nu) * (1.6 if step % 5 == 0 else 1.0)
    action = action.astype(np.float32).astype(np.float64)
    observation, reward, terminated, truncated, _ = environment.step(action)
    assert not terminated and not truncated
    touching += data.ncon > 0
    steps.append(
        {
            "action": action.tolist(),
            "qpos": data.qpos.tolist(),
            "qvel": data.qvel.tolist(),
            "observation": observation.tolist(),
            "reward": float(reward),
        }
    )
assert touching > STEPS // 2, touching

reference = {
    "gymnasium": gymnasium.__version__,
    "mujoco": mujoco.__version__,
    "qpos": qpos.tolist(),
    "qvel": qvel.tolist(),
    "steps": steps,
}
path = pathlib.Path(__file__).with_suffix(".json")
with path.open("w") as file:
    file.write("{\n")
    for key in ("gymnasium", "mujoco", "qpos", "qvel"):
        file.write(f'"{key}": {json.dumps(reference[key])},\n')
    file.write('"steps": [\n' + ",\n".join(json.dumps(step) for step in steps) + "\n]}\n")
print(f"{path.name}: {STEPS} steps, {touching} of them with contacts")
