"""What is wrong, in words that demosift passes on."""

import os

#: Letters of a line of a message that are passed on.
LONGEST_LINE = 300
#: What helps where an environment is none of Gymnasium's kind.
OLD_API = (
    "step() has to return observation, reward, terminated, truncated, info, and reset(seed=..., options=...) observation, info; an "
    "environment of the old gym is wrapped by shimmy.GymV21CompatibilityV0(env=...), one of gym 0.26 by GymV26CompatibilityV0"
)
#: What Python says where wrappers cannot take apart what a step or a reset returned, and where a reset takes no seed.
OLD = {
    ValueError: ("expected 5, got 4", "too many values to unpack (expected 2"),
    TypeError: ("reset() got an unexpected keyword argument 'seed'",),
}


class Refused(Exception):
    """The environment works, and demosift cannot use it; says why, and what would help."""

    def __init__(self, message, hint=None):
        super().__init__(message)
        self.hint = hint


class Returned(Exception):
    """The environment returned what cannot be used; says what, as the end of a sentence about it, and what would help."""

    def __init__(self, what, hint=None):
        super().__init__(f"returned {what}")
        self.hint = hint


class Fault(Exception):
    """A function of the user's beside the environment did what cannot be used; says which function and what."""


def in_words(error):
    """What was raised, and where."""
    found = problem(error)
    return found["message"] + (f" ({found['place']})" if found["place"] else "")


def listed(names):
    return ", ".join(f"'{name}'" for name in sorted(names)) or "nothing"


def in_short(lines):
    """The first and the last line of a message, which may say what happened and where."""
    lines = [line.strip()[:LONGEST_LINE] for line in lines if line.strip()]
    return " | ".join(lines if len(lines) < 3 else [lines[0], "…", lines[-1]])


def problem(error):
    """An error with its type, the first and the last line of what it says, and the place in the code."""
    import traceback

    if isinstance(error, Fault):
        return {"kind": "function", "message": str(error), "hint": None, "place": None}
    if isinstance(error, Refused):
        return {"kind": "refused", "message": str(error), "hint": error.hint, "place": None}
    if isinstance(error, Returned):
        return {"kind": "returned", "message": str(error), "hint": error.hint, "place": None}
    frames = traceback.extract_tb(error.__traceback__)
    theirs = [frame for frame in frames if not frame.filename.startswith(("<string>", "<demosift_worker"))]
    place = None
    if theirs:
        last = theirs[-1]
        place = f"{os.path.basename(last.filename)}, line {last.lineno}, in {last.name}"
    if isinstance(error, SyntaxError) and error.filename:
        place = f"{os.path.basename(error.filename)}, line {error.lineno}"
    lines = "".join(traceback.format_exception_only(type(error), error)).splitlines()
    # Before an error of syntax stands the code.
    message = in_short(lines[-1:] if isinstance(error, SyntaxError) else lines)
    is_old = any(isinstance(error, kind) and any(part in message for part in said) for kind, said in OLD.items())
    return {"kind": "raised", "message": message, "hint": OLD_API if is_old else None, "place": place}
