"""Functions of yours as the command names them: it runs them in other processes."""

from __future__ import annotations

import base64
import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .errors import Mistake
from .sets import HOME, write_whole

_PICKLED = '''"""Written by demosift: a function of a notebook or script, as cloudpickle keeps it."""

import base64
import sys

import cloudpickle

sys.path += [folder for folder in {folders!r} if folder not in sys.path]
function = cloudpickle.loads(base64.b64decode("""
{lines}
"""))
{name} = function
'''


_WANTED = {
    "env": "a function without arguments, a class",
    "trainer": "a function of demonstrations and a seed",
    "measure": "a function of env, obs, reward and info that returns a dict of numbers",
    "heuristic": "words such as 'sum reward', a function of observations, actions and rewards that returns a number",
}


def named(function: str | Callable[..., Any], what: str, home: Path = HOME) -> str:
    """A function as the command takes it: ``file.py:name`` or ``module:name``; text is taken as it is.

    What lies in a file is named, and imported by the workers.
    What has no name there (a lambda, a function within another, one of a notebook or of the script that runs) is written to
    a file in `home` by cloudpickle.
    """
    if isinstance(function, str):
        return function
    if not callable(function):
        raise Mistake(
            f"{what} is a {type(function).__name__}", f"wanted {_WANTED[what]}, or its name as text"
        )
    module_name, name = getattr(function, "__module__", None), getattr(function, "__qualname__", None)
    module = sys.modules.get(module_name or "")
    if module is None or module_name == "__main__" or name is None or _found(module, name) is not function:
        return _pickled(function, what, home)
    assert module_name is not None
    # A package, too, is imported by its name: run as a file it would not find what lies in it.
    if "." in module_name or hasattr(module, "__path__") or getattr(module, "__file__", None) is None:
        return f"{module_name}:{name}"
    return f"{os.path.abspath(str(module.__file__))}:{name}"


def _found(module: Any, name: str) -> Any:
    found = module
    for part in name.split("."):
        found = getattr(found, part, None)
    return found


def _own_folders() -> list[str]:
    """Where this program finds modules beyond what is installed: the function may need them."""
    installed = (os.path.abspath(sys.prefix), os.path.abspath(sys.base_prefix))
    folders = [os.path.abspath(folder) for folder in sys.path]
    return [folder for folder in folders if os.path.isdir(folder) and not folder.startswith(installed)]


def _pickled(function: Callable[..., Any], what: str, home: Path) -> str:
    try:
        import cloudpickle
    except ImportError as error:
        raise Mistake(
            f"{what} is a function of a notebook, of the script that runs, or without a name, and workers cannot import it",
            "install cloudpickle, or put it into a file and import it from there",
        ) from error
    pickled = base64.encodebytes(cloudpickle.dumps(function)).decode()
    own = getattr(function, "__name__", "function")
    # A lambda's is no name.
    name = own if own.isidentifier() else "function"
    text = _PICKLED.format(lines=pickled.strip(), folders=_own_folders(), name=name).encode()
    path = home / f"function-{hashlib.sha256(text).hexdigest()[:12]}.py"
    if not path.exists():
        write_whole(path, lambda file: file.write(text))
    return f"{Path(path).absolute()}:{name}"
