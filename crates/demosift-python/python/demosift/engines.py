"""One run by many processes or machines: functions that `demosift.sift(..., map=...)` takes.

Whatever calls a function with each of some items and returns the results in order will do: the `map` of a pool of processes,
of Dask or of mpi4py.
Here are those that need a line more.

    from demosift import engines

    demosift.sift(..., out="/shared/run", parts=16, map=engines.ray(num_cpus=4))
    demosift.sift(..., out="/shared/run", parts=16, map=engines.submitit(executor))

All machines must see the folder of the run, and have demosift of the same version.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

Item = TypeVar("Item")
Found = TypeVar("Found")
Map = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]


def ray(**options: Any) -> Map:
    """A task of Ray for each part; `options` are those of `ray.remote`, such as ``num_cpus=4``.

    A task whose worker dies is tried again by Ray, and goes on from what it had stored.
    """
    import ray as engine

    def mapped(function: Callable[[Item], Found], items: Iterable[Item]) -> Iterable[Found]:
        # Ray takes plain functions only.
        def call(item: Item) -> Found:
            return function(item)

        remote = engine.remote(**options)(call) if options else engine.remote(call)
        found: list[Found] = engine.get([remote.remote(item) for item in items])
        return found

    return mapped


def submitit(executor: Any) -> Map:
    """A job array of Slurm, or what else an executor of submitit stands for, with a job for each part."""

    def mapped(function: Callable[[Item], Found], items: Iterable[Item]) -> Iterable[Found]:
        return [job.result() for job in executor.map_array(function, list(items))]

    return mapped
