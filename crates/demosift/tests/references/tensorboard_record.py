"""Prints the bytes stored in the test of src/tensorboard.rs: the same events written by TensorBoard's own writer.

Needs tensorboard (2.21 printed what is stored).
"""

import io

from tensorboard.compat.proto.event_pb2 import Event
from tensorboard.compat.proto.summary_pb2 import Summary
from tensorboard.summary.writer.record_writer import RecordWriter

values = [
    Summary.Value(tag="judge/demonstration 3/score", simple_value=0.1),
    Summary.Value(tag="judge/demonstration 3/kl", simple_value=-1e30),
]
events = [
    Event(wall_time=0, file_version="brain.Event:2"),
    Event(wall_time=301, step=1000, summary=Summary(value=values)),
]
for event in events:
    file = io.BytesIO()
    RecordWriter(file).write(event.SerializeToString())
    print(file.getvalue().hex())
