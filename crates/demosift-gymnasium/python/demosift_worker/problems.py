"""What is wrong, in words that demosift passes on."""

import os


class Refused(Exception):
    """The environment works, and demosift cannot use it; says why, and what would help."""

    def __init__(self, message, hint=None):
        super().__init__(message)
        self.hint = hint


class Fault(Exception):
    """A function of the user's beside the environment did what cannot be used; says which function and what."""


def in_words(error):
    """What was raised, and where."""
    found = problem(error)
    return found["message"] + (f" ({found['place']})" if found["place"] else "")


def listed(names):
    return ", ".join(f"'{name}'" for name in sorted(names)) or "nothing"


def problem(error):
    """An error as its last line says it, with the place in the code."""
    import traceback

    if isinstance(error, Fault):
        return {"kind": "function", "message": str(error), "hint": None, "place": None}
    if isinstance(error, Refused):
        return {"kind": "refused", "message": str(error), "hint": error.hint, "place": None}
    frames = traceback.extract_tb(error.__traceback__)
    theirs = [frame for frame in frames if not frame.filename.startswith(("<string>", "<demosift_worker"))]
    place = None
    if theirs:
        last = theirs[-1]
        place = f"{os.path.basename(last.filename)}, line {last.lineno}, in {last.name}"
    lines = "".join(traceback.format_exception_only(type(error), error)).strip().splitlines()
    return {"kind": "raised", "message": (lines or [type(error).__name__])[-1], "hint": None, "place": place}
