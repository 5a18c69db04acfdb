"""A stand-in for robosuite: a hand on a line that pushes a cube, with what of the real one demosift relies on.

As there, a reset ignores seeds, what a controller remembers is in no state, observations are cached until they are forced,
an episode that is over cannot be stepped, and a recorded model has to be edited before it is loaded.
"""

from robosuite.environments import ALL_ENVIRONMENTS
from robosuite.environments.base import make

__version__ = "1.5.2"
