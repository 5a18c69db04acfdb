"""Observations as rows of numbers, and actions within bounds."""

from demosift_worker.problems import OLD_API, Refused

DEEPEST = 8


def check_not_old(space, what):
    """Refuses a space of the old gym, whose classes have the names of Gymnasium's and are others."""
    if type(space).__module__.split(".")[0] == "gym":
        raise Refused(f"the {what} space is the {type(space).__name__} of gym, and wanted is that of gymnasium", OLD_API)


def leaves(space, name="", depth=0):
    """The parts of an observation space by the order of their names: name, space, and how to get there."""
    from gymnasium import spaces

    check_not_old(space, "observation")
    if depth > DEEPEST:
        raise Refused(f"the observation space is nested more than {DEEPEST} deep")
    if isinstance(space, spaces.Dict):
        inner = [(key, key, part) for key, part in sorted(space.spaces.items())]
    elif isinstance(space, spaces.Tuple):
        # Those of a set have the names that they have there.
        names = getattr(space, "names", None) or [f"_index_{index}" for index in range(len(space.spaces))]
        inner = [(label, index, part) for index, (label, part) in enumerate(zip(names, space.spaces))]
    else:
        return [(name or "observation", space, ())]
    found = []
    for label, key, part in inner:
        below = leaves(part, f"{name}/{label}" if name else str(label), depth + 1)
        found.extend((label, leaf, (key, *way)) for label, leaf, way in below)
    return found


def flattener(name, space, way):
    """How a part of an observation becomes numbers, and how many."""
    import numpy
    from gymnasium import spaces

    if isinstance(space, spaces.Box):
        is_image = len(space.shape) >= 3 or (space.dtype == numpy.uint8 and len(space.shape) == 2)
        if is_image:
            raise Refused(
                f"the part '{name}' of an observation is an image of shape {space.shape}, and policies of demosift read numbers",
                "leave images out of the observation, such as by gymnasium.wrappers.FilterObservation",
            )
        single = numpy.dtype("<f4")
        numbers = lambda value: numpy.asarray(value, dtype=single).ravel()
        return numbers, int(numpy.prod(space.shape, dtype=int))
    if isinstance(space, (spaces.Discrete, spaces.MultiDiscrete, spaces.MultiBinary)):
        numbers = lambda value: numpy.asarray(spaces.flatten(space, value), dtype="<f4")
        return numbers, spaces.flatdim(space)
    raise Refused(
        f"the part '{name}' of an observation is a {type(space).__name__}, which has no fixed numbers",
        "wanted Box, Discrete, MultiDiscrete or MultiBinary, alone or in Dict and Tuple",
    )


def action_bounds(space):
    """What the action space can be: a Box with finite bounds."""
    import numpy
    from gymnasium import spaces

    check_not_old(space, "action")
    if not isinstance(space, spaces.Box):
        raise Refused(
            f"the action space is {type(space).__name__}, and policies of demosift act in a Box of numbers",
            "wanted gymnasium.spaces.Box with finite bounds",
        )
    if not numpy.issubdtype(space.dtype, numpy.floating):
        raise Refused(f"actions are of type {space.dtype}, and must be floating-point numbers")
    low, high = space.low.ravel().astype(float), space.high.ravel().astype(float)
    for number, (least, greatest) in enumerate(zip(low, high)):
        if not (numpy.isfinite(least) and numpy.isfinite(greatest) and least < greatest):
            raise Refused(
                f"action {number} has the bounds {least} and {greatest}, and both must be finite, the first below the second",
                "give the action_space of the environment the bounds that it has in truth",
            )
    return [[float(least), float(greatest)] for least, greatest in zip(low, high)]
