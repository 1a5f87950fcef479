"""Values of a controller's parts, found by their name."""

import dataclasses
from collections.abc import Iterator, Mapping

from evoros.base.checks import is_number


def find_values(part: object, name: str, at: str) -> Iterator[tuple[str, float]]:
    """Yield the dotted key and the value of each number called ``name`` in a description.

    ``at`` is the key of ``part`` itself.
    """
    if dataclasses.is_dataclass(part):
        children = {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}
    elif isinstance(part, Mapping):
        children = dict(part)
    else:
        return
    for key, child in children.items():
        if key == name and is_number(child):
            yield f"{at}.{key}", float(child)
        else:
            yield from find_values(child, name, f"{at}.{key}")


def find_avoidance_range(controller: object) -> tuple[str, float] | None:
    """Return the key and the value [m] of the maximum ``range_m`` of a controller's layers."""
    ranges = find_values(controller, "range_m", "controller")
    return max(ranges, key=lambda entry: entry[1], default=None)
