"""The command ``demosift``: as a program, and asked from here in a process of its own.

Whatever runs for long runs in a process of its own.
It stops at once when it is interrupted, whatever its threads do, and what goes wrong in it takes no notebook with it.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO, Any, NoReturn

from . import _demosift
from .errors import Failed, Mistake

#: Exit code of the user's mistake.
MISTAKE = 2
#: What asks the command for lines of progress, and how such a line begins.
PROGRESS_VARIABLE, PROGRESS_LINE = "DEMOSIFT_PROGRESS", "progress: "
PR_SET_PDEATHSIG = 1
#: Seconds that an interrupted command has to end.
GRACE = 10.0

_CHILD = "import sys; sys.path[0] = sys.argv.pop(1); from demosift.command import child; child()"


def main() -> NoReturn:
    """The program ``demosift``."""
    sys.exit(_demosift.run(["demosift", *sys.argv[1:]]))


def child() -> NoReturn:
    """The same in a process that ends with whoever started it, whose number is the first argument."""
    parent = int(sys.argv.pop(1))
    try:
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    except (OSError, AttributeError):
        pass
    if os.getppid() != parent:
        sys.exit(1)
    main()


def ask(words: Sequence[str | os.PathLike[str]], bar: bool = False, notes: bool = True) -> str:
    """What the command answers to these words on standard output; its notes go to standard error, if they are wanted.

    Raises `Mistake` or `Failed` with the words of the command, and with what it answered all the same.
    """
    typed = [os.fspath(word) for word in words]
    package = str(Path(__file__).parent.parent)
    process = subprocess.Popen(
        [sys.executable, "-c", _CHILD, package, str(os.getpid()), *typed],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        # Ctrl-C is for us, and passed on once.
        start_new_session=True,
        env={**os.environ, PROGRESS_VARIABLE: "lines"},
        encoding="utf-8",
        errors="replace",
    )
    assert process.stdout is not None and process.stderr is not None
    answer: list[str] = []
    reader = threading.Thread(target=_read, args=(process.stdout, answer), daemon=True)
    reader.start()
    progress = _Progress(bar)
    try:
        error, hint = _listen(process.stderr, progress, notes)
        code = process.wait()
    except BaseException:
        _stop(process)
        raise
    finally:
        progress.close()
        reader.join()
        process.stdout.close()
        process.stderr.close()
    said = "".join(answer)
    if code == 0:
        return said
    if error is None:
        error = f"the command ended {f'by signal {-code}' if code < 0 else f'with exit code {code}'}"
    raise (Mistake if code == MISTAKE else Failed)(error, hint, said)


def ask_json(words: Sequence[str | os.PathLike[str]], bar: bool = False, notes: bool = True) -> Any:
    """The same with ``--json``, read."""
    return json.loads(ask([*words, "--json"], bar, notes))


def options(**given: Any) -> list[str]:
    """Keywords as options: ``time_limit=5`` is ``--time-limit 5``; None and False say nothing, True stands alone."""
    words: list[str] = []
    for name, value in given.items():
        option = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        words.append(option if value is True else f"{option}={os.fspath(value) if isinstance(value, os.PathLike) else value}")
    return words


def _read(stream: IO[str], into: list[str]) -> None:
    into.append(stream.read())


def _stop(process: subprocess.Popen[str]) -> None:
    """Interrupts the command, which finishes the write that is under way, and waits for its end."""
    process.send_signal(signal.SIGINT)
    try:
        process.wait(GRACE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _listen(lines: Iterable[str], progress: _Progress, notes: bool) -> tuple[str | None, str | None]:
    """Shows progress and notes; returns the error and its hint, if there is one."""
    told: list[str] = []
    hints: list[str] = []
    for line in lines:
        line = line.rstrip("\n")
        if line.startswith(PROGRESS_LINE):
            progress.show(json.loads(line[len(PROGRESS_LINE) :]))
        elif line.startswith("error: "):
            told = [line[len("error: ") :]]
        elif told and line.startswith("hint: "):
            hints = [line[len("hint: ") :]]
        elif hints or told:
            (hints or told).append(line)
        elif notes:
            print(line, file=sys.stderr)
    return "\n".join(told) or None, "\n".join(hints) or None


class _Progress:
    """A bar for the stage that runs, where tqdm is installed."""

    def __init__(self, wanted: bool) -> None:
        self.bar: Any = None
        self.make: Any = None
        if wanted:
            try:
                from tqdm.auto import tqdm
            except ImportError:
                return
            self.make = tqdm

    def show(self, told: dict[str, Any]) -> None:
        if self.make is None:
            return
        if self.bar is None or told.get("stage") is not None:
            self.close()
            self.bar = self.make(total=told.get("total"), desc=told.get("stage"))
        self.bar.update(told["done"] - self.bar.n)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()
            self.bar = None
