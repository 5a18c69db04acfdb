"""Plays an ONNX policy with onnxruntime; tests/onnx.rs calls it.

    PYTHONPATH=.python python3 play_onnx.py MODEL OBSERVATIONS ACTIONS CONTROLS

OBSERVATIONS are 32-bit floats, row after row; ACTIONS and CONTROLS are written so.
Where the package onnx is installed too, its checker looks at the model first (1.23.2 found nothing).
"""

import sys

import numpy as np
import onnxruntime

model, observations, actions, controls = sys.argv[1:]
try:
    import onnx
except ImportError:
    pass
else:
    onnx.checker.check_model(onnx.load(model), full_check=True)

session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
(taken,) = session.get_inputs()
assert (taken.name, taken.type, taken.shape[0]) == ("observation", "tensor(float)", "batch"), taken
assert [given.name for given in session.get_outputs()] == ["action", "control"]
rows = np.fromfile(observations, np.float32).reshape(-1, taken.shape[1])
action, control = session.run(None, {"observation": rows})
for output, given in zip(session.get_outputs(), (action, control)):
    assert output.shape == ["batch", given.shape[1]] and given.shape[0] == len(rows)
# Another length of the batch, which sums in another order.
(single,) = session.run(["action"], {"observation": rows[:1]})
np.testing.assert_allclose(single, action[:1], rtol=0, atol=1e-5)
action.tofile(actions)
control.tofile(controls)
