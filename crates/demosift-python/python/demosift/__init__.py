"""Which demonstrations should your agent learn from? demosift finds out by imitating each one in your simulator.

    import demosift

    result = demosift.sift("my_demonstrations.hdf5", env="my_env.py:make", heuristic="any is_success")
    result.ranking            # a DataFrame where pandas is installed, else a list of dicts
    result.kept               # numbers of the demonstrations to train on
    result.of("my_demonstrations.hdf5")  # these, as arrays
    result.policy(observation)
    result.report()           # shows itself in a notebook

Every function does what a subcommand of the command ``demosift`` does, which is installed with this package.
A run is a folder on disk: what is finished is not lost, and ``resume=True`` goes on with it.
"""

from ._demosift import VERSION as __version__
from .errors import Error, Failed, Mistake
from .policies import Policy
from .runs import Report, Result, check, export, judge, load, sift
from .sets import Episode, Set, open

__all__ = [
    "Episode",
    "Error",
    "Failed",
    "Mistake",
    "Policy",
    "Report",
    "Result",
    "Set",
    "__version__",
    "check",
    "export",
    "judge",
    "load",
    "open",
    "sift",
]
