"""Functions of the user's beside the environment, which measure more of a step or score an episode."""

from collections.abc import Mapping

from demosift_worker.naming import named
from demosift_worker.problems import Fault, in_words, listed

#: What every environment measures, and the name of what a function says of a whole episode.
ALWAYS, SCORE = ("reward", "terminated"), "score"


def as_number(value):
    """A number of info as a float; None if it is none."""
    import numbers

    import numpy

    if isinstance(value, (bool, numbers.Real, numpy.bool_)):
        return float(value)
    if isinstance(value, numpy.ndarray) and value.size == 1 and value.dtype.kind in "biuf":
        return float(value.ravel()[0])
    return None


class Own:
    """A function of the user's beside the environment: `measure` after each step, or `score` of an episode."""

    def __init__(self, asked, wanted):
        self.words = asked["words"]
        try:
            self.function = named(asked)
        except Exception as error:
            raise Fault(f"{self.words} cannot be imported: {in_words(error)}") from None
        if not callable(self.function):
            raise Fault(f"{self.words} is of type {type(self.function).__name__}; wanted a function {wanted}")

    def call(self, when, *arguments):
        try:
            return self.function(*arguments)
        except Exception as error:
            raise Fault(f"{self.words} failed {when}: {in_words(error)}") from None

    def number(self, value, when, name=None):
        """A finite number that it returned, under a name if there are several."""
        number, what = as_number(value), self.words if name is None else f"{self.words}: '{name}'"
        if number is None:
            verb = "returned an object" if name is None else "is"
            raise Fault(f"{what} {verb} of type {type(value).__name__} {when}; wanted a number")
        if not -float("inf") < number < float("inf"):
            raise Fault(f"{what} {'returned' if name is None else 'is'} {number} {when}; wanted a finite number")
        return number


class Measure(Own):
    """More numbers of each step, by `measure(env, obs, reward, info)`, which returns them by name."""

    def __init__(self, asked, taken):
        super().__init__(asked, "measure(env, obs, reward, info), which returns numbers by name")
        self.taken, self.names = taken, None

    def numbers(self, env, step, observation, reward, info):
        when = f"after step {step}"
        found = self.call(when, env, observation, reward, info)
        if not isinstance(found, Mapping):
            raise Fault(
                f"{self.words} returned an object of type {type(found).__name__} {when}; wanted a dict of numbers, such as "
                "{'gap': 0.1}"
            )
        numbers = {str(name): self.number(value, when, name) for name, value in found.items()}
        if self.names is None:
            self.names = set(numbers)
            if not numbers:
                raise Fault(f"{self.words} returned an empty dict {when}; wanted at least one number")
        if set(numbers) != self.names:
            raise Fault(
                f"{self.words} returned {listed(numbers)} {when}, and {listed(self.names)} after the first; wanted the same names "
                "each time"
            )
        taken = [name for name in numbers if name in self.taken or as_number(info.get(name)) is not None]
        if taken:
            raise Fault(f"{self.words} returned '{taken[0]}' {when}, which is measured already; wanted another name")
        return numbers


class Score(Own):
    """The heuristic of a whole episode, by `score(observations, actions, rewards)`."""

    def __init__(self, asked, numpy):
        super().__init__(asked, "score(observations, actions, rewards), which returns a number")
        self.numpy = numpy
        self.begin()

    def begin(self, observation=None):
        self.observations, self.actions, self.rewards = [] if observation is None else [observation], [], []

    def add(self, observation, action, reward):
        self.observations.append(observation)
        self.actions.append(action)
        self.rewards.append(reward)

    def number_of_episode(self):
        when = f"on an episode of {len(self.actions)} steps"
        arrays = self.numpy.stack(self.observations), self.numpy.stack(self.actions), self.numpy.array(self.rewards)
        return self.number(self.call(when, *arrays), when)
