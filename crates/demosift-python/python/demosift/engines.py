"""One run by many processes or machines: functions that `demosift.sift(..., map=...)` takes.

Whatever calls a function with each of some items, waits, and returns the results in order will do: the `map` of a pool of
processes, that of an executor of mpi4py, or `client.get_executor().map` of dask.distributed, whose `client.map` returns futures.
Here are those that need a line more.

    from demosift import engines

    demosift.sift(..., out="/shared/run", parts=16, map=engines.ray(num_cpus=4))
    demosift.sift(..., out="/shared/run", parts=16, map=engines.submitit(executor))

All machines must see the folder of the run, and have demosift of the same version.
A part that fails takes no other with it: in its place stands its exception, and the others go on.
Ctrl-C ends them all.
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
        tasks = [remote.remote(item) for item in items]
        try:
            return [_or_error(engine.get, task) for task in tasks]
        except BaseException:
            for task in tasks:
                engine.cancel(task)
            raise

    return mapped


class _Again:
    """A function that submitit calls again, with the same item, where its job was ended by a limit of time or for another job:
    each call goes on from what the one before had stored."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.function = function

    def __call__(self, item: Any) -> Any:
        return self.function(item)

    def __submitit_checkpoint__(self, item: Any) -> Any:
        from submitit.helpers import DelayedSubmission

        return DelayedSubmission(self, item)

    #: Under this name submitit (1.5.4) looks whether there is one.
    checkpoint = __submitit_checkpoint__


def submitit(executor: Any) -> Map:
    """A job array of Slurm, or what else an executor of submitit stands for, with a job for each part.

    A job that comes to its limit of time is put into the queue again, as often as `slurm_max_num_timeout` of the executor says.
    """

    def mapped(function: Callable[[Item], Found], items: Iterable[Item]) -> Iterable[Found]:
        jobs = executor.map_array(_Again(function), list(items))
        try:
            return [_or_error(lambda job: job.result(), job) for job in jobs]
        except BaseException:
            for job in jobs:
                job.cancel()
            raise

    return mapped


def _or_error(wait: Callable[[Any], Found], task: Any) -> Found | Any:
    """What came of a task, or the exception with which it failed."""
    try:
        return wait(task)
    except Exception as error:
        return error
