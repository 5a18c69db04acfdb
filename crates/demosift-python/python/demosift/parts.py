"""A run in parts: each does every n-th piece of the work into a folder of its own, and the whole collects them."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from . import command
from .engines import Map
from .errors import Error, Failed, Mistake

#: Parts are asked again while pieces come to be known that hang on what others found; far more often than there are stages.
_ROUNDS = 100
#: Stages that start from the prior of the paper's judge.
_FROM_PRIOR = {"judge_paper", "subset_selection"}
#: Options whose value is a file, or a function in one.
_FILES = {"--env", "--trainer", "--heuristic", "--measure", "--config", "--set-file", "--task", "--python"}


def in_parts(words: Sequence[str | os.PathLike[str]], out: Path, parts: int, map: Map) -> None:
    """Judges and trains in parts, as far as the run of these words can be shared out and goes into the folder `out`."""
    # Who judges is known to the command alone: values, a file of them, or the speed of an environment may say it.
    plan = command.ask_json(["sift", *words, "--resume", "--dry-run"], notes=False)
    left = {stage["stage"] for stage in plan["stages"]}
    # What has no parts is done here: in the learning of the prior and in weighing each round starts from the one before.
    if left & _FROM_PRIOR:
        command.ask(["meta-train", *words, "--resume"])
    if "subset_selection" in left:
        command.ask(["weigh", *words, "--resume"])
    stages = ["judge"] if any(stage.startswith("judge_") for stage in left) else []
    # Of several goals each has a folder of its own, which whoever collects makes; the parts share out what is judged for all.
    if "referee" in left and not plan["goals"]:
        stages.append("referee")
    for stage in stages:
        is_all = _share_out(stage, words, out, parts, map)
        if stage == "judge" and "referee" in stages and not is_all:
            # What is to be trained on is known once all are judged: what a part that failed has not judged is judged here.
            command.ask(["judge", *words, "--resume"])


def _share_out(stage: str, words: Sequence[str | os.PathLike[str]], out: Path, parts: int, map: Map) -> bool:
    """Asks the parts until nothing is left, or until a round changes nothing; returns whether nothing is left."""
    before = None
    for _ in range(_ROUNDS):
        now = (_round(stage, words, parts, map), _stored(out))
        if not any(now[0]):
            return True
        if now == before:
            break
        before = now
    return False


def _round(stage: str, words: Sequence[str | os.PathLike[str]], parts: int, map: Map) -> list[list[str]]:
    """Asks each part once; returns what each of those that did not fail has left to others.

    What a part that failed did not do is done by others or by whoever collects, so it is an error only if all failed.
    """
    found: list[Any] = []
    typed = [os.fspath(word) for word in words]
    try:
        for outcome in map(partial(_part, stage, typed), [f"{part}/{parts}" for part in range(1, parts + 1)]):
            found.append(outcome)
    except Exception as error:
        # Of who calls, such as of a pool one of whose processes was killed.
        found.append(error)
    _check(found)
    failed = [error for error in (_error(outcome) for outcome in found) if error is not None]
    if failed and len(failed) == len(found):
        raise failed[0]
    for error in failed:
        warnings.warn(f"a part of the run failed, and the others go on: {error}", stacklevel=2)
    return [outcome["left"] for outcome in found if _error(outcome) is None]


def _check(found: Sequence[Any]) -> None:
    """Whether these are what `_part` returned."""
    for outcome in found:
        if isinstance(outcome, (Exception, dict)):
            continue
        for other in found:
            # Such as a future of dask.distributed.
            getattr(other, "cancel", lambda: None)()
        raise Mistake(
            f"map returned a {type(outcome).__name__} in the place of what a part found",
            "wanted something that waits for the results and returns them in order, as the map of a pool of processes does; "
            "of dask.distributed it is client.get_executor().map",
        )


def _error(outcome: Any) -> Exception | None:
    """What went wrong in a part, if something did."""
    if isinstance(outcome, Exception):
        return outcome
    if "error" not in outcome:
        return None
    kind = Mistake if outcome["is_mistake"] else Failed
    return kind(outcome["error"], outcome["hint"])


def _part(stage: str, words: Sequence[str], part: str) -> dict[str, Any]:
    """Does one part, wherever it is called; returns what others have not finished, or what went wrong, as plain data."""
    try:
        left: list[str] = command.ask_json([stage, *words, f"--part={part}"])["left"]
    except Error as error:
        return {"error": error.message, "hint": error.hint, "is_mistake": isinstance(error, Mistake)}
    return {"left": left}


def _stored(out: Path) -> list[tuple[str, int]]:
    """What the parts have stored: a part that did anything has another file, or a longer one."""
    files = [path for path in (out / "parts").glob("*/*") if not path.name.startswith(".")]
    stored = []
    for path in files:
        try:
            stored.append((str(path), path.stat().st_size))
        except OSError:
            # A part that goes on has replaced it.
            continue
    return sorted(stored)


def absolute(word: str | os.PathLike[str]) -> str:
    """A word that means the same elsewhere: paths of what is here are made absolute, also in options and in `file.py:name`."""
    typed = os.fspath(word)
    if not typed.startswith("-"):
        return os.path.abspath(typed) if os.path.exists(typed) else typed
    option, _, value = typed.partition("=")
    if option not in _FILES:
        return typed
    file, _, name = value.rpartition(":")
    if file.endswith(".py") and os.path.isfile(file):
        return f"{option}={os.path.abspath(file)}:{name}"
    return f"{option}={os.path.abspath(value)}" if os.path.exists(value) and not _is_name(option, value) else typed


def _is_name(option: str, value: str) -> bool:
    """Whether the command takes it as a name, whatever lies here: one on the PATH, such as python3, or of a task that it knows."""
    if os.sep in value:
        return False
    return option == "--python" or (option == "--task" and value in command.ask_json(["tasks"]))
