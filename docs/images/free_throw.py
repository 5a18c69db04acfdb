"""Draws docs/images/free_throw.png: three demonstrations of data/free_throw_8, from hopeless to successful.

pip install mujoco==3.17.0 pillow h5py, then: MUJOCO_GL=egl python docs/images/free_throw.py
"""

from pathlib import Path

import h5py
import mujoco
import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
DEMONSTRATIONS = [1, 0, 4]  # stages after 0, 16 and 221 updates, see data/provenance/free_throw_8.json
STEPS = [0, 6, 14, 22, 30, 38]
HORIZON = 60

model = mujoco.MjModel.from_xml_path(str(ROOT / "tasks/free_throw/free_throw.xml"))
data = mujoco.MjData(model)
renderer = mujoco.Renderer(model, height=200, width=200)
with h5py.File(ROOT / "data/free_throw_8/demonstrations.hdf5") as file:
    qpos = file["infos/qpos"][:]
rows = []
for demonstration in DEMONSTRATIONS:
    frames = []
    for step in STEPS:
        data.qpos = qpos[demonstration * HORIZON + step]
        mujoco.mj_forward(model, data)
        renderer.update_scene(data, camera="side")
        frames.append(renderer.render())
    rows.append(np.concatenate(frames, axis=1))
Image.fromarray(np.concatenate(rows, axis=0)).quantize(64).save(ROOT / "docs/images/free_throw.png", optimize=True)
