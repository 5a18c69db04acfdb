"""Reads the events of a run folder as TensorBoard does, and compares them with its metrics.jsonl.

    python3 events.py RUN_FOLDER

Needs tensorboard; it was 2.21.0 when this last said that they agree.
"""

import json
import math
import pathlib
import sys

import numpy as np
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

folder = pathlib.Path(sys.argv[1])
wanted = {}
for line in (folder / "metrics.jsonl").read_text().splitlines():
    row = json.loads(line)
    stage, part, iteration = row.pop("stage"), row.pop("part"), row.pop("iteration")
    for name, value in row.items():
        if value is not None:
            tag = "/".join(word for word in (stage, part, name) if word)
            wanted.setdefault(tag, []).append((iteration, value))

# Of 0 numbers a tag it keeps all; it reads every tfevents file of the folder.
events = EventAccumulator(str(folder), size_guidance={"scalars": 0, "tensors": 0})
events.Reload()
tags = events.Tags()["scalars"]
assert sorted(tags) == sorted(wanted), set(tags) ^ set(wanted)
points = 0
for tag in tags:
    found = [(point.step, point.value) for point in events.Scalars(tag)]
    assert len(found) == len(wanted[tag]), (tag, len(found), len(wanted[tag]))
    for (step, value), (iteration, measured) in zip(found, wanted[tag]):
        assert step == iteration, (tag, step, iteration)
        assert math.isfinite(value) and np.float32(value) == np.float32(measured), (tag, step, value, measured)
    points += len(found)
print(f"{len(tags)} tags, {points} points: as in metrics.jsonl")
