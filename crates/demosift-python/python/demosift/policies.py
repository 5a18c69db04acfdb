"""Policies that runs have trained."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _demosift
from .errors import Mistake

if TYPE_CHECKING:
    import numpy

#: A part of a column: `name[3]`, `name[0:35]`, `name[4:]` or `name[:7]`.
_PART = re.compile(r"(?P<column>.*)\[(?:(?P<only>\d+)|(?P<first>\d*):(?P<end>\d*))\]")
_ZEROS_AND_ONES = "a Discrete part has to be laid out as zeros and ones, as gymnasium.spaces.flatten does, and MultiDiscrete too"


class Policy:
    """A policy from its safetensors: called with an observation, it gives the mean action.

    Normalization and clipping are inside.
    With `bounds`, the least and greatest of each number of an action, it acts in the environment's own unit; without, each
    number is from -1 to 1.
    With `columns`, those of an observation in the set that it learned from, the parts of a dict are taken in their order;
    without, in the order of their names. `Result.policy` knows both.

        action = policy(observation)             # [act]
        actions = policy(observations)           # [n, act] for observations [n, obs]
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        bounds: Sequence[tuple[float, float]] | None = None,
        columns: Sequence[str] = (),
    ) -> None:
        path = Path(path)
        try:
            self._policy = _demosift.Policy(path.read_bytes(), "the policy", bounds)
        except OSError as error:
            raise Mistake(f"the policy cannot be read: {error}") from error
        except ValueError as error:
            raise Mistake(f"{error.args[0]}: {path}") from error
        self.path = path
        self.columns = tuple(columns)

    @property
    def observation_size(self) -> int:
        """Numbers in an observation."""
        return self._policy.observation_size

    @property
    def action_size(self) -> int:
        """Numbers in an action."""
        return self._policy.action_size

    def __call__(self, observation: Any) -> numpy.ndarray:
        """The action `[act]` on an observation `[obs]`, or on each of several; parts of a dict are taken by name."""
        import numpy

        has_parts = isinstance(observation, (Mapping, tuple))
        numbers = flat(observation, self.columns)
        rows = numbers.reshape(-1, numbers.shape[-1]) if numbers.ndim else numbers.reshape(1, 1)
        try:
            acted = [self._policy.act(numpy.ascontiguousarray(row, dtype="<f4").tobytes()) for row in rows]
        except ValueError as error:
            raise Mistake(str(error.args[0]), _ZEROS_AND_ONES if has_parts else None) from error
        actions = numpy.frombuffer(b"".join(acted), dtype="<f4").reshape(len(acted), self.action_size)
        return actions[0].copy() if numbers.ndim < 2 else actions.copy()

    def __repr__(self) -> str:
        return f"demosift.Policy({str(self.path)!r}): {self.observation_size} observations, {self.action_size} actions"


def flat(observation: Any, columns: Sequence[str] = ()) -> numpy.ndarray:
    """An observation as numbers: parts of a dict as these columns name them, or in the order of their names."""
    import numpy

    if isinstance(observation, Mapping):
        found = [_part(observation, column) for column in columns]
        missing = [column for column, part in zip(columns, found) if part is None]
        # A column that stands alone, and in no group, may be all of an observation under a name of its own.
        if missing and (len(columns) > 1 or "/" in missing[0]):
            raise Mistake(
                f"the observation has no part '{missing[0].rpartition('/')[2]}', which the policy learned from; it has: "
                + ", ".join(sorted(str(name) for name in observation)),
                f"wanted a dict with the columns of the set, {', '.join(columns)}, or their numbers in one array",
            )
        if missing or not columns:
            found = [flat(observation[name]) for name in sorted(observation)]
        return numpy.concatenate([part.ravel() for part in found if part is not None])
    if isinstance(observation, tuple):
        return numpy.concatenate([flat(part).ravel() for part in observation])
    return numpy.asarray(observation, dtype=numpy.float32)


def _part(observation: Mapping[str, Any], column: str) -> numpy.ndarray | None:
    """The numbers of a column of a set, which is named with the groups around it; None if they are not there."""
    whole = _below(observation, column)
    if whole is not None:
        return flat(whole)
    part = _PART.fullmatch(column)
    whole = _below(observation, part["column"]) if part else None
    if part is None or whole is None:
        return None
    if part["only"]:
        return flat(whole).ravel()[int(part["only"]) :][:1]
    return flat(whole).ravel()[int(part["first"] or 0) : int(part["end"]) if part["end"] else None]


def _below(observation: Mapping[str, Any], column: str) -> Any:
    """What has this name, or what of it follows the groups that only a file has: `obs/gripper` is the `gripper`."""
    names = column.split("/")
    for outer in range(len(names)):
        found: Any = observation
        for name in names[outer:]:
            if isinstance(found, tuple):
                found = {f"_index_{index}": part for index, part in enumerate(found)}
            found = found.get(name) if isinstance(found, Mapping) else None
        if found is not None:
            return found
    return None
