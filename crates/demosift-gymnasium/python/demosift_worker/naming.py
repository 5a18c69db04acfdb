"""What a user names: a function or class in a file or module, and the versions of what that imports."""

import os
import sys


def named(asked):
    """What has this name in a file or module."""
    import importlib

    found = import_file(asked["file"]) if asked["kind"] == "file" else importlib.import_module(asked["module"])
    for part in asked["name"].split("."):
        found = getattr(found, part)
    return found


def import_file(path):
    """The module in a file, whose neighbors it can import."""
    import importlib.util

    folder, name = os.path.dirname(path), os.path.splitext(os.path.basename(path))[0]
    known = sys.modules.get(name)
    if known is not None and getattr(known, "__file__", None) == path:
        # An environment and what measures it may lie in one file, which is run once.
        return known
    sys.path.insert(0, folder)
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def takes(function, name):
    """Whether a function can be called with an argument of this name."""
    import inspect

    try:
        parameters = inspect.signature(function).parameters
    except (TypeError, ValueError):
        return False
    return name in parameters or any(one.kind is inspect.Parameter.VAR_KEYWORD for one in parameters.values())


def versions_of(names):
    """Of Python, numpy and those of these modules that are imported."""
    import platform
    from importlib import metadata

    import numpy

    found = {"python": platform.python_version(), "numpy": numpy.__version__}
    for name in names:
        module = sys.modules.get(name)
        if module is None or name in found:
            continue
        try:
            version = getattr(module, "__version__", None) or metadata.version(name)
        except Exception:
            continue
        if isinstance(version, str):
            found[name] = version
    return found
