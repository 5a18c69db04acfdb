"""Errors of demosift as exceptions, with the same words as on the command line."""

from __future__ import annotations


class Error(Exception):
    """What went wrong; `hint` says what could be done about it, or is None."""

    def __init__(self, message: str, hint: str | None = None, answer: str = "") -> None:
        super().__init__(message if hint is None else f"{message}\nhint: {hint}")
        self.message = message
        self.hint = hint
        #: What the command answered before it went wrong.
        self.answer = answer


class Mistake(Error, ValueError):
    """What you can mend: wrong data, arguments or configuration, a full disk."""


class Failed(Error, RuntimeError):
    """A run that went wrong, such as an environment that raised an exception."""
