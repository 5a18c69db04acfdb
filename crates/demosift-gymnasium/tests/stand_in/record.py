"""Records episodes of the stand-in for robosuite, as robosuite's own collector does: `record.py NAME`, JSON on standard output."""

import json
import sys

import numpy
import robosuite

made = robosuite.make(
    sys.argv[1], robots=["Hand"], ignore_done=True, has_offscreen_renderer=False, use_camera_obs=False
)
random = numpy.random.default_rng(4)
episodes = []
for steps in (9, 12, 7):
    made.reset()
    model, state = made.model, made.sim.get_state().flatten()
    made.reset_from_xml_string(made.edit_model_xml(model))
    made.sim.set_state_from_flattened(state)
    made.sim.forward()
    observed = made._get_observations(force_update=True)
    found = {"model": model, "states": [], "actions": [], "object": [], "robot0_eef_pos": []}
    for _ in range(steps):
        # More bits than a number of 32 bits has.
        action = random.uniform([0.0, -1.0], [2.0, 1.0])
        found["states"].append(list(made.sim.get_state().flatten()))
        found["actions"].append(list(action))
        found["object"].append(list(observed["object-state"]))
        found["robot0_eef_pos"].append(list(observed["robot0_eef_pos"]))
        observed, _, _, _ = made.step(action)
    episodes.append(found)
json.dump(episodes, sys.stdout)
