"""Measures what judging costs as a set grows: processor time, memory, files. It makes the sets that it measures.

python3 docs/results/scale.py set N FILE               writes N demonstrations: those of data/martial_arts_100, with small noise
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "data/martial_arts_100/demonstrations.hdf5"
# Of the spread of each number over the whole set.
NOISE = 0.02


def write_set(count, path):
    """Demonstration i is a copy of demonstration i mod 100 of the source, the first hundred too with noise of their own."""
    import h5py
    import numpy

    with h5py.File(SOURCE) as file:
        tables = {name: file[name][:] for name in ("observations", "actions")}
        ends = numpy.flatnonzero(file["timeouts"][:] | file["terminals"][:]) + 1
    starts = numpy.concatenate([[0], ends[:-1]])
    random = numpy.random.default_rng(1)
    chosen = [numpy.arange(starts[i % len(ends)], ends[i % len(ends)]) for i in range(count)]
    rows = numpy.concatenate(chosen)
    with h5py.File(path, "w") as file:
        for name, table in tables.items():
            noise = random.standard_normal((len(rows), table.shape[1]), dtype=numpy.float32)
            file[name] = table[rows] + (NOISE * table.std(axis=0)).astype(numpy.float32) * noise
        timeouts = numpy.zeros(len(rows), dtype=bool)
        timeouts[numpy.cumsum([len(one) for one in chosen]) - 1] = True
        file["timeouts"] = timeouts
        file["terminals"] = numpy.zeros(len(rows), dtype=bool)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["set", count, path]:
            write_set(int(count), path)
        case _:
            sys.exit(__doc__)
