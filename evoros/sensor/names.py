"""The names of mounted sensors in the description of a robot: type and number, as ``sonar_0``.

If the robot has such a name already, all its mounted sensors have a prefix.
"""

import re
from collections.abc import Collection, Iterable

_PREFIX = "evoros_"


def choose_prefix(taken: Iterable[str], types: Collection[str]) -> str:
    """Return a prefix with which no name of a sensor of these types is ``taken``; empty if it can.

    It depends on the robot and the types alone, and so do the names of all designs.
    """
    return _PREFIX * (_highest_level(taken, types) + 1)


def find_prefix(links: Iterable[str], types: Collection[str]) -> str:
    """Return the prefix of the sensors of these types that are mounted on a robot."""
    return _PREFIX * max(_highest_level(links, types), 0)


def _highest_level(names: Iterable[str], types: Collection[str]) -> int:
    """Return how many prefixes the names of sensors among ``names`` have at most; -1 if none is."""
    pattern = rf"((?:{_PREFIX})*)(?:{'|'.join(map(re.escape, types))})_[0-9]+(?:_joint)?"
    matches = (re.fullmatch(pattern, name) for name in names) if types else ()
    return max((len(match[1]) // len(_PREFIX) for match in matches if match), default=-1)
