"""A run in parts: each does every n-th piece of the work into a folder of its own, and the whole collects them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from . import command
from .engines import Map
from .errors import Mistake

#: How a part says that its judge starts from a prior and the run has none; `job/mod.rs` of the command says it.
_NO_PRIOR = "needs the prior, which is learned once"
#: Parts are asked again while pieces come to be known that hang on what others found; far more often than there are stages.
_ROUNDS = 100


def in_parts(words: Sequence[str | os.PathLike[str]], options: Mapping[str, Any], parts: int, map: Map) -> None:
    """Judges and trains in parts, as far as the run of these words can be shared out."""
    typed = [_absolute(word) for word in words]
    if _lacks_prior(typed, options, parts):
        # Each of its rounds starts from the one before, so it has no parts.
        command.ask(["meta-train", *typed, "--resume"])
    stages = ["judge"] if options.get("referee") == "none" else ["judge", "referee"]
    for stage in stages:
        for _ in range(_ROUNDS):
            left = list(map(partial(_part, stage, typed), [f"{part}/{parts}" for part in range(1, parts + 1)]))
            if not any(left):
                break


def _lacks_prior(words: Sequence[str], options: Mapping[str, Any], parts: int) -> bool:
    """Whether the run has still to learn a prior.

    Who judges is known to the command alone: values, a file of them, or the speed of an environment may say it.
    """
    if options.get("judge") in ("cloning", "trainer") and options.get("keep") != "weights":
        return False
    try:
        command.ask(["judge", *words, f"--part=1/{parts}", "--dry-run"], notes=False)
    except Mistake as error:
        if _NO_PRIOR not in error.message:
            raise
        return True
    return False


def _part(stage: str, words: Sequence[str], part: str) -> list[str]:
    """Does one part, wherever it is called; returns what others have not finished."""
    left: list[str] = command.ask_json([stage, *words, f"--part={part}"])["left"]
    return left


def _absolute(word: str | os.PathLike[str]) -> str:
    """A word that means the same elsewhere: paths of what is here are made absolute."""
    typed = os.fspath(word)
    return os.path.abspath(typed) if not typed.startswith("-") and os.path.exists(typed) else typed
