"""Names of mounted sensors in a robot description: type and number, such as ``sonar_0``.

If the robot already has such a name, all its mounted sensors get a prefix.
"""

import re
from collections.abc import Collection, Iterable

_PREFIX = "evoros_"


def choose_prefix(taken: Iterable[str], types: Collection[str]) -> str:
    """Return the shortest prefix that keeps the names of sensors of these types out of ``taken``.

    It depends only on the robot and the types, so all designs use the same names.
    """
    return _PREFIX * (_highest_level(taken, types) + 1)


def find_prefix(links: Iterable[str], types: Collection[str]) -> str:
    """Return the prefix of the sensors of these types on a robot."""
    return _PREFIX * max(_highest_level(links, types), 0)


def _highest_level(names: Iterable[str], types: Collection[str]) -> int:
    """Return the maximum number of prefixes on a sensor name among ``names``; -1 without any."""
    pattern = rf"((?:{_PREFIX})*)(?:{'|'.join(map(re.escape, types))})_[0-9]+(?:_joint)?"
    matches = (re.fullmatch(pattern, name) for name in names) if types else ()
    return max((len(match[1]) // len(_PREFIX) for match in matches if match), default=-1)
