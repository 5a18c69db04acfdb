"""Runs: what they are asked for, and what they found."""

from __future__ import annotations

import html
import json
import os
import sys
import tempfile
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, overload

from . import command
from .callables import named
from .engines import Map
from .errors import Mistake
from .parts import absolute, in_parts
from .policies import Policy
from .sets import HOME, Episode, open_in
from .sets import open as open_set

#: The folder of a run in parts for what was given to it from memory.
_INPUTS = "inputs"
#: Which judge and which referee an imitator means.
_IMITATION = {
    "cloning": {"judge": "cloning", "values": ["referee.gail=0"]},
    "gail": {"judge": "paper", "values": ["referee.cloning=0"]},
}


class Report:
    """The page of a run; a notebook shows it."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def _repr_html_(self) -> str:
        page = html.escape(self.path.read_text(encoding="utf-8"), quote=True)
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 800px; border: 0"></iframe>'

    def __repr__(self) -> str:
        return f"demosift.Report({str(self.path)!r})"


class Result:
    """What a run found, read from its folder."""

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        if not (self.folder / "run.json").is_file():
            raise Mistake(f"this is no run folder: {self.folder}", "wanted a folder that a run has written")

    @cached_property
    def _exported(self) -> dict[str, Any]:
        if self.goals:
            raise Mistake(
                "the run is about several goals, and each has a result of its own",
                f"take one of result.goals: {', '.join(self.goals)}",
            )
        exported: dict[str, Any] = json.loads(
            command.ask(["export", self.folder, "--as", "json"], notes=False)
        )
        return exported

    @cached_property
    def goals(self) -> dict[str, Result]:
        """The result for each goal, where the task has several; empty where it has one."""
        if (self.folder / "ranking.json").is_file():
            return {}
        inner = sorted(path.parent for path in self.folder.glob("*/run.json"))
        return {folder.name: Result(folder) for folder in inner}

    @property
    def ranking(self) -> Any:
        """A row for each demonstration, the most suitable first: a DataFrame where pandas is installed, else a list of dicts."""
        return _table(self._exported["demonstrations"])

    @property
    def kept(self) -> list[int]:
        """Numbers of the demonstrations to train on, in the order of the set: what the referee recommends.

        A number is a position in the file, from 0; `of` takes these from a set, some of whose episodes may have been left out.
        """
        return [row["demonstration"] for row in self._kept_rows()]

    def of(self, demonstrations: Any) -> list[Episode]:
        """The demonstrations to train on, out of the set that was sifted, which is whatever `demosift.open` takes."""
        rows = self._kept_rows()
        episodes = open_set(demonstrations).numbered(row["demonstration"] for row in rows)
        for row, episode in zip(rows, episodes):
            if (episode.label, len(episode)) != (row["label"], row["steps"]):
                raise Mistake(
                    f"demonstration {episode.number} of the set is '{episode.label}' with {len(episode)} steps, and in the run it is "
                    f"'{row['label']}' with {row['steps']}",
                    "give the set that was sifted",
                )
        return episodes

    def _kept_rows(self) -> list[dict[str, Any]]:
        rows = [row for row in self._exported["demonstrations"] if row["kept"]]
        return sorted(rows, key=lambda row: row["demonstration"])

    @property
    def verdict(self) -> str | None:
        """What to train on, and whether selecting helps, in a sentence; None where nothing was trained."""
        found = self._read("verdict.json")
        return None if found is None else str(found["sentence"])

    @cached_property
    def policy(self) -> Policy:
        """The policy to take, called with an observation; in an environment of Python it acts in its own unit.

        Where your own trainer did best there is none, and its error says what to do.
        """
        path = self.folder / "policy_best.safetensors"
        trainer = self._winning_trainer()
        if trainer is not None:
            onnx = self.folder / "policy_best.onnx"
            raise Mistake(
                f"the best policies are those of your own trainer, {trainer}: {self.folder}",
                f"the best of them is {onnx}" if onnx.is_file() else "let it train on result.kept",
            )
        if not path.is_file():
            raise Mistake(f"the run has no policy: {self.folder}", "the referee trains policies; it was asked for none")
        run = self._read("run.json") or {}
        columns = ((run.get("data") or {}).get("columns") or {}).get("observations") or ()
        return Policy(path, (run.get("simulator") or {}).get("bounds"), columns)

    def _winning_trainer(self) -> str | None:
        """The user's own trainer, if that is who should train."""
        found = self._read("verdict.json") or {}
        winner = found.get("winner")
        if winner is None or found["pairs"][winner]["imitator"] != "trainer":
            return None
        return str(found["trainer"]["name"])

    def report(self) -> Report:
        """The page of the run, made if it is not there."""
        path = self.folder / "report.html"
        if not path.is_file():
            command.ask(["report", self.folder])
        return Report(path)

    def _read(self, name: str) -> dict[str, Any] | None:
        path = self.folder / name
        if not path.is_file():
            return None
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return found

    def _repr_html_(self) -> str:
        words = html.escape(self.verdict or "Ranked; nothing was trained.")
        shows = None if self.goals else getattr(self.ranking, "_repr_html_", None)
        return f"<p>{words}</p>{shows() if shows else ''}"

    def __repr__(self) -> str:
        return f"demosift.Result({str(self.folder)!r}): {self.verdict or 'no verdict'}"


@overload
def sift(demonstrations: Any, *, dry_run: Literal[True], **options: Any) -> dict[str, Any]: ...
@overload
def sift(
    demonstrations: Any,
    *,
    env: str | Callable[[], Any] | None = None,
    task: str | None = None,
    heuristic: str | Callable[[Any, Any, Any], float] | None = None,
    measure: str | Callable[[Any, Any, float, dict[str, Any]], Mapping[str, float]] | None = None,
    imitation: str | None = None,
    workers: int | None = None,
    horizon: int | None = None,
    out: str | os.PathLike[str] | None = None,
    resume: bool = False,
    values: Mapping[str, Any] | None = None,
    python: str | os.PathLike[str] | None = None,
    trainer: str | Callable[[list[Any], int], Any] | None = None,
    progress: bool = True,
    map: Map | None = None,
    parts: int | None = None,
    dry_run: Literal[False] = False,
    **options: Any,
) -> Result: ...
def sift(
    demonstrations: Any,
    *,
    env: str | Callable[[], Any] | None = None,
    task: str | None = None,
    heuristic: str | Callable[[Any, Any, Any], float] | None = None,
    measure: str | Callable[[Any, Any, float, dict[str, Any]], Mapping[str, float]] | None = None,
    imitation: str | None = None,
    workers: int | None = None,
    horizon: int | None = None,
    out: str | os.PathLike[str] | None = None,
    resume: bool = False,
    values: Mapping[str, Any] | None = None,
    python: str | os.PathLike[str] | None = None,
    trainer: str | Callable[[list[Any], int], Any] | None = None,
    progress: bool = True,
    map: Map | None = None,
    parts: int | None = None,
    dry_run: bool = False,
    **options: Any,
) -> Result | dict[str, Any]:
    """Ranks demonstrations, keeps the best, and trains policies to show whether that was worth it.

    `demonstrations` is whatever `demosift.open` takes.
    `env` is an environment of Gymnasium: ``"gymnasium:HalfCheetah-v5"``, ``"my_env.py:make"``, ``"from-set"``, or a function
    without arguments, or class, that makes one; `task` is a task of demosift instead.
    `heuristic` says what a good episode is, such as ``"any is_success"``; by default the sum of rewards. It may be a function
    ``score(observations, actions, rewards)`` of a whole episode that returns a number, higher being better: arrays
    `[T + 1, obs]`, `[T, act]` in the environment's own unit, and `[T]`.
    `measure` measures more of each step, for the words of a heuristic: ``measure(env, obs, reward, info)`` returns a dict of
    numbers, the same names each time.
    `imitation` is ``"cloning"`` or ``"gail"`` if only that is to judge and train.
    `python` is the interpreter of the environment and the trainer, by default this one.
    `trainer` trains policies of your own kind: ``train(demonstrations, seed)`` gets a list of episodes with `observations`
    `[T, obs]` and `actions` `[T, act]`, and returns a policy, a function from an observation to an action; or its name,
    ``"my_train.py:train"``. The referee then says what *that* learner should be trained on, and with ``judge="trainer"`` it
    judges the demonstrations too, by three trainings on each.
    `values` are values of the configuration, such as ``{"judge.iterations": 3}``.
    Other keywords are options of ``demosift sift``: ``preset="quick"``, ``judge="cloning"``, ``referee="none"``, ``keep=5``,
    ``seed=1``, ``threads=2``, ``variant="left"``, ``time_limit=120``, ``trainer_timeout=3600``.

    Ctrl-C stops it, and ``resume=True`` goes on.

    `map` shares the work out in `parts`, such as the `map` of a pool of processes or those of `demosift.engines`; the folder
    `out` must be seen by all who take part.

    With `dry_run` no run is begun, and what it would cost is returned: the answer of ``--dry-run --json``, with `stages`,
    `environment_steps` and `minutes`.
    """
    home = HOME
    if map is not None or parts is not None:
        if map is None or parts is None or out is None:
            raise Mistake("map, parts and out go together: who calls, how many parts there are, and the folder they share")
        out = Path(out).absolute()
        resume = True
        if not dry_run:
            # Whoever takes part sees the folder of the run, and perhaps nothing else of here.
            home = out / _INPUTS
    job = _job(
        home=home,
        env=env,
        trainer=trainer,
        heuristic=heuristic,
        measure=measure,
        task=task,
        python=python,
        workers=workers,
        horizon=horizon,
    )
    values = dict(values or {})
    words = [f"{key}={value}" for key, value in values.items()]
    if imitation is not None:
        if imitation not in _IMITATION:
            raise Mistake(f"imitation is {imitation!r}, and must be 'cloning' or 'gail'")
        options.setdefault("judge", _IMITATION[imitation]["judge"])
        if options.get("referee") is None:
            words += _IMITATION[imitation]["values"]
    sets = [word for value in words for word in ("--set", value)]
    asked = [*open_in(home, demonstrations).words(), *job, *sets]
    if map is not None and parts is not None and out is not None and not dry_run:
        in_parts([absolute(word) for word in [*asked, *command.options(out=out, **options)]], Path(out), parts, map)
    how = command.options(out=out, resume=resume, dry_run=dry_run, **options)
    answer: dict[str, Any] = command.ask_json(["sift", *asked, *how], bar=progress)
    return answer if dry_run else Result(answer["run_folder"])


def load(folder: str | os.PathLike[str]) -> Result:
    """The result of an earlier run."""
    return Result(folder)


def check(
    demonstrations: Any = None,
    *,
    env: str | Callable[[], Any] | None = None,
    task: str | None = None,
    heuristic: str | Callable[[Any, Any, Any], float] | None = None,
    measure: str | Callable[[Any, Any, float, dict[str, Any]], Mapping[str, float]] | None = None,
    horizon: int | None = None,
    python: str | os.PathLike[str] | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Tries an environment, and holds demonstrations against it: what ``demosift task check --json`` shows.

    That something is wrong is no exception here; one of the findings says so.

        demosift.check("my_demonstrations.hdf5", env=make)["findings"]
    """
    job = _job(env=env, python=python, heuristic=heuristic, measure=measure, horizon=horizon)
    data = []
    if demonstrations is not None:
        path, *how = open_set(demonstrations).words()
        data = ["--data", path, *how]
    named_task = [] if task is None else [task]
    words = ["task", "check", *named_task, *job, *data, *command.options(**options)]
    try:
        answer: dict[str, Any] = command.ask_json(words)
    except Mistake as error:
        if not error.answer:
            raise
        answer = json.loads(error.answer)
    return answer


def judge(
    demonstrations: Any, *, prior: str | os.PathLike[str] | Result, progress: bool = True, **options: Any
) -> Any:
    """Where new demonstrations, of which one is enough, would stand in the ranking of an earlier run.

    A row for each, by the judge whose order is taken there: a DataFrame where pandas is installed, else a list of dicts.
    With ``dry_run=True`` what it would cost, as a dict.
    """
    folder = prior.folder if isinstance(prior, Result) else prior
    asked = ["judge", *open_set(demonstrations).words(), "--prior", folder]
    with tempfile.TemporaryDirectory() as scratch:
        out = {} if "out" in options else {"out": Path(scratch) / "judged"}
        answer = command.ask_json([*asked, *command.options(**out, **options)], bar=progress)
    if options.get("dry_run"):
        return answer
    said = answer["judges"]
    deciding = [one for one in said if one["judge"] == answer["decides"]] or said
    return _table([{"goal": one["goal"], **row} if one["goal"] else row for one in deciding for row in one["standings"]])


def export(result: Result | str | os.PathLike[str], form: str, out: str | os.PathLike[str] | None = None, **options: Any) -> Any:
    """Hands on what a run kept: `form` is ``"lerobot"``, ``"minari"``, ``"robomimic-filter-key"``, ``"onnx"``, ``"csv"`` and so on.

    Returns the path that was written, or the text where `out` is none.
    """
    folder = result.folder if isinstance(result, Result) else result
    text = command.ask(["export", folder, "--as", form, *command.options(out=out, **options)])
    return text if out is None else Path(out)


def _job(
    *,
    home: Path = HOME,
    env: str | Callable[[], Any] | None,
    python: str | os.PathLike[str] | None,
    trainer: str | Callable[..., Any] | None = None,
    heuristic: str | Callable[..., Any] | None = None,
    measure: str | Callable[..., Any] | None = None,
    **options: Any,
) -> list[str]:
    """The environment or task, the trainer, and what is measured, as options."""
    functions = {"env": env, "trainer": trainer, "heuristic": heuristic, "measure": measure}
    ours = {what: None if function is None else named(function, what, home) for what, function in functions.items()}
    if ours["env"] or ours["trainer"]:
        ours["python"] = os.fspath(python or sys.executable)
    return command.options(**ours, **options)


def _table(rows: list[dict[str, Any]]) -> Any:
    try:
        import pandas
    except ImportError:
        return rows
    return pandas.DataFrame(rows)
