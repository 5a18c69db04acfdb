"""Policies that runs have trained."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _demosift
from .errors import Mistake

if TYPE_CHECKING:
    import numpy


class Policy:
    """A policy from its safetensors: called with an observation, it gives the mean action.

    Normalization and clipping are inside.
    With `bounds`, the least and greatest of each number of an action, it acts in the environment's own unit; without, each
    number is from -1 to 1.

        action = policy(observation)             # [act]
        actions = policy(observations)           # [n, act] for observations [n, obs]
    """

    def __init__(
        self, path: str | os.PathLike[str], bounds: Sequence[tuple[float, float]] | None = None
    ) -> None:
        path = Path(path)
        try:
            self._policy = _demosift.Policy(path.read_bytes(), "the policy", bounds)
        except OSError as error:
            raise Mistake(f"the policy cannot be read: {error}") from error
        except ValueError as error:
            raise Mistake(f"{error.args[0]}: {path}") from error
        self.path = path

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

        numbers = flat(observation)
        rows = numbers.reshape(-1, numbers.shape[-1]) if numbers.ndim else numbers.reshape(1, 1)
        try:
            acted = [self._policy.act(numpy.ascontiguousarray(row, dtype="<f4").tobytes()) for row in rows]
        except ValueError as error:
            raise Mistake(str(error.args[0])) from error
        actions = numpy.frombuffer(b"".join(acted), dtype="<f4").reshape(len(acted), self.action_size)
        return actions[0].copy() if numbers.ndim < 2 else actions.copy()

    def __repr__(self) -> str:
        return f"demosift.Policy({str(self.path)!r}): {self.observation_size} observations, {self.action_size} actions"


def flat(observation: Any) -> numpy.ndarray:
    """An observation as numbers: parts of a dict in the order of their names, as demosift reads them."""
    import numpy

    if isinstance(observation, Mapping):
        parts = [flat(observation[name]).ravel() for name in sorted(observation)]
        return numpy.concatenate(parts)
    if isinstance(observation, tuple):
        return numpy.concatenate([flat(part).ravel() for part in observation])
    return numpy.asarray(observation, dtype=numpy.float32)
