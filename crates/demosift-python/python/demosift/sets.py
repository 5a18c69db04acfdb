"""Demonstrations: files of other tools, arrays from memory, and data sets of Minari and LeRobot."""

from __future__ import annotations

import builtins
import hashlib
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _demosift, command
from .errors import Mistake

if TYPE_CHECKING:
    import numpy

#: Where arrays from memory are written, beside the runs that are about them.
HOME = Path("runs")


@dataclass(frozen=True)
class Episode:
    """One demonstration in the numbers of its file: observations `[T, obs]`, actions `[T, act]`, both float32.

    `number` is its position in the file, from 0, by which rankings and `Result.kept` name it; `label` is what the file calls it.
    """

    number: int
    label: str
    observations: numpy.ndarray
    actions: numpy.ndarray

    def __len__(self) -> int:
        return len(self.actions)


@dataclass(frozen=True)
class Set:
    """Demonstrations on disk, and how they are read; it behaves as a sequence of `Episode`.

    An index counts the episodes that were chosen; each keeps the `number` that it has in the file.
    """

    path: Path
    format: str | None = None
    observation_columns: tuple[str, ...] = ()
    action_columns: tuple[str, ...] = ()
    episodes: str | None = None
    _read: list[Episode] = field(default_factory=list, init=False, repr=False, compare=False)

    @staticmethod
    def from_arrays(
        pairs: Iterable[tuple[Any, Any]], path: str | os.PathLike[str] | None = None
    ) -> Set:
        """A set of arrays from memory: a pair of observations `[T, obs]` and actions `[T, act]` for each demonstration.

        Observations may have one row more, the last one, on which no action was taken.
        They are written to `path`, a new npz file, by default `runs/arrays-<hash>.npz`: a run needs them when it goes on.

            demosift.Set.from_arrays([(observations, actions), ...])
        """
        return Set._of_arrays(pairs, path, HOME)

    @staticmethod
    def _of_arrays(
        pairs: Iterable[tuple[Any, Any]], path: str | os.PathLike[str] | None, home: Path
    ) -> Set:
        import numpy

        observed, acted, starts = [], [], []
        for number, (observations, actions) in enumerate(pairs):
            actions = numpy.asarray(actions, dtype=numpy.float32)
            observations = numpy.asarray(observations, dtype=numpy.float32)
            if len(observations) == len(actions) + 1:
                observations = observations[:-1]
            if len(observations) != len(actions) or len(actions) == 0:
                raise Mistake(
                    f"demonstration {number} has {len(observations)} observations and {len(actions)} actions",
                    "wanted as many of both, at least one, or one observation more",
                )
            observed.append(observations.reshape(len(observations), -1))
            acted.append(actions.reshape(len(actions), -1))
            starts.append(numpy.arange(len(actions)) == 0)
        if not acted:
            raise Mistake("there are no demonstrations in the arrays")
        for what, parts in (("observation", observed), ("action", acted)):
            widths = {part.shape[1] for part in parts}
            if len(widths) > 1:
                raise Mistake(f"the numbers in an {what} differ between demonstrations: {sorted(widths)}")
        arrays: dict[str, Any] = {
            "obs": numpy.concatenate(observed),
            "actions": numpy.concatenate(acted),
            "episode_starts": numpy.concatenate(starts),
        }
        digest = hashlib.sha256(b"".join(array.tobytes() for array in arrays.values()))
        target = home / f"arrays-{digest.hexdigest()[:12]}.npz" if path is None else Path(path)
        if path is not None and target.exists():
            raise Mistake(f"this exists already: {target}", "give a path that is free")
        if not target.exists():
            write_whole(target, lambda file: numpy.savez(file, **arrays))
        return Set(target)

    def words(self) -> list[str]:
        """The set as the command takes it."""
        return [
            os.fspath(self.path),
            *command.options(
                format=self.format,
                observation_columns=",".join(self.observation_columns) or None,
                action_columns=",".join(self.action_columns) or None,
                episodes=self.episodes,
            ),
        ]

    def inspect(self) -> dict[str, Any]:
        """What is in it, as ``demosift inspect --json`` shows it."""
        answer: dict[str, Any] = command.ask_json(["inspect", *self.words()])
        return answer

    def numbered(self, numbers: Iterable[int]) -> list[Episode]:
        """The episodes of these numbers, in this order."""
        wanted = list(numbers)
        known = {episode.number: episode for episode in self}
        missing = [number for number in wanted if number not in known]
        if missing:
            raise Mistake(
                f"the set has no demonstration {missing[0]}; its {len(known)} have numbers from {min(known)} to {max(known)}",
                "a number is a position in the file, from 0; open the set with the episodes that were sifted",
            )
        return [known[number] for number in wanted]

    def _all(self) -> list[Episode]:
        if not self._read:
            import numpy

            columns = builtins.list(self.observation_columns), builtins.list(self.action_columns)
            try:
                read = _demosift.read(self.path, self.format, *columns, self.episodes)
            except ValueError as error:
                raise Mistake(*error.args) from error
            for number, label, observed, observations, acted, actions in read:
                self._read.append(
                    Episode(
                        number,
                        label,
                        numpy.frombuffer(observed, "<f4").reshape(-1, observations),
                        numpy.frombuffer(acted, "<f4").reshape(-1, actions),
                    )
                )
        return self._read

    def __len__(self) -> int:
        return len(self._all())

    def __getitem__(self, index: int) -> Episode:
        return self._all()[index]

    def __iter__(self) -> Iterator[Episode]:
        return iter(self._all())


def open(
    path: Any,
    *,
    columns: Sequence[str] | None = None,
    action_columns: Sequence[str] | None = None,
    format: str | None = None,
    episodes: str | None = None,
) -> Set:
    """A set of any format that demosift reads, told apart by looking.

    `path` is a file or folder, a data set of `minari` or `lerobot`, or a list of pairs of arrays.
    `columns` make an observation, `action_columns` an action, both in this order; `episodes` is a list such as `"0-9,12"`,
    which are then at 0 to 10 of the set, each with the `number` that it has in the file.

        demonstrations = demosift.open("lift.hdf5", columns=["obs/joints", "obs/object"])
        len(demonstrations), demonstrations[0].observations.shape
    """
    return open_in(HOME, path, columns=columns, action_columns=action_columns, format=format, episodes=episodes)


def open_in(
    home: Path,
    path: Any,
    *,
    columns: Sequence[str] | None = None,
    action_columns: Sequence[str] | None = None,
    format: str | None = None,
    episodes: str | None = None,
) -> Set:
    """The same, where arrays from memory are written into the folder `home`."""
    if isinstance(path, Set):
        return path
    chosen = episodes
    if not isinstance(path, (str, os.PathLike)):
        if isinstance(path, (list, tuple)):
            return Set._of_arrays(path, None, home)
        path, known = _place_of(path)
        chosen = chosen or known
    return Set(Path(path), format, tuple(columns or ()), tuple(action_columns or ()), chosen)


def _place_of(dataset: Any) -> tuple[str, str | None]:
    """Where a data set of another library lies, and which of its episodes are meant."""
    storage = getattr(dataset, "storage", None)
    if storage is not None and hasattr(storage, "data_path"):
        indices = getattr(dataset, "episode_indices", None)
        total = getattr(storage, "total_episodes", None)
        chosen = indices if indices is not None and total is not None and len(indices) != total else None
        return os.fspath(storage.data_path), _listed(chosen)
    if hasattr(dataset, "root") and hasattr(dataset, "meta"):
        return os.fspath(dataset.root), _listed(getattr(dataset, "episodes", None))
    raise Mistake(
        f"demonstrations cannot be read from a {type(dataset).__name__}",
        "wanted a path, a list of pairs (observations, actions), or a data set of minari or lerobot",
    )


def _listed(episodes: Iterable[Any] | None) -> str | None:
    """Numbers of episodes as `--episodes` takes them."""
    return None if episodes is None else ",".join(str(int(number)) for number in episodes)


def write_whole(path: Path, write: Any) -> None:
    """Writes a file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    half = path.with_name(f".{path.name}-{os.getpid()}")
    try:
        with builtins.open(half, "wb") as file:
            write(file)
        os.replace(half, path)
    finally:
        half.unlink(missing_ok=True)
