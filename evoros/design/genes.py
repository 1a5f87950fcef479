"""From genes in 0..1 to values, and from values to the parts of an experiment that hold them."""

import dataclasses
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Annotated, Any, TypeVar

from evoros.base.checks import FLAG, NUMBER, TEXT, checked, invalid, is_number, is_whole
from evoros.base.errors import InputError
from evoros.base.intervals import pick_index, scale

Part = TypeVar("Part")

# What an individual *is* may evolve. Its worlds, failures and simulator are the test: evolution
# would make the test easier rather than the robot better. The rest of the robot comes from files.
EVOLVABLE = (
    "controller.",
    "design.sensors.",
    "robot.drive.max_speed_mps",
    "robot.drive.steering_limit_rad",
)
FEW = 10
"""Up to so many genes, all 2^n combinations of their ends are tried: half a second at most."""
CLOCK = re.compile(r"controller\.period_s|design\.sensors\.[^.]+\.period_s")


@dataclass(frozen=True)
@checked
class Gene:
    """One evolved value: the dotted key of a number in the configuration, and its range.

    The key starts with one of ``EVOLVABLE``, and is not a period of the controller or a sensor.
    """

    key: Annotated[str, TEXT]
    low: Annotated[float, NUMBER]
    high: Annotated[float, NUMBER]
    whole: Annotated[bool, FLAG] = False  # whole numbers only, both ends included

    def __post_init__(self) -> None:
        if not self.key.startswith(EVOLVABLE) or not all(self.key.split(".")):
            rule = f"must be a dotted key that starts with {' or '.join(EVOLVABLE)}"
            cure = "worlds, failures and the simulator are the test and do not evolve"
            raise invalid(self, "key", self.key, rule, cure)
        if CLOCK.fullmatch(self.key):
            rule = "must not be a period that has to be a multiple of the time step"
            raise invalid(self, "key", self.key, rule, "choose another key")
        if self.high < self.low:
            raise invalid(self, "high", self.high, f"must be at least low, which is {self.low}")
        if self.whole and not (is_whole(self.low) and is_whole(self.high)):
            value = [self.low, self.high]
            raise invalid(
                self, "whole", value, "low and high must be whole numbers where it is true"
            )

    def value(self, gene: float) -> float:
        """The value at ``gene`` (0..1); a whole number where the gene is whole."""
        if self.whole:
            return self.low + pick_index(gene, int(self.high - self.low) + 1)
        return scale(gene, float(self.low), float(self.high))


def replace_values(part: Part, values: Mapping[str, float], at: str = "") -> Part:
    """A copy of ``part`` that has, at each dotted path, the given number instead of its own.

    Walks through fields of dataclasses, keys of mappings and positions in lists. Each dataclass on
    the way is built once, with all its changes, and so checks itself again. ``at`` is where
    ``part`` stands, for messages.

    Raises:
        InputError: a path does not lead to a number, or a part refuses its new values.
    """
    inner: dict[str, dict[str, float]] = {}
    for path, value in values.items():
        head, _, rest = path.partition(".")
        inner.setdefault(head, {})[rest] = value
    children = _children(part)
    changes: dict[str, Any] = {}
    for head, deeper in inner.items():
        where = f"{at}.{head}" if at else head
        if head not in children:
            there = f"there is {', '.join(children)}" if children else "there are no values inside"
            raise InputError(f"{where}: must lead to an existing value; {at or 'here'}: {there}")
        if set(deeper) != {""}:
            changes[head] = replace_values(children[head], deeper, where)
        elif is_number(children[head]):
            changes[head] = deeper[""]
        else:
            kind = type(children[head]).__name__
            inside = ", ".join(_children(children[head])) or "nothing"
            raise InputError(f"{where}: must lead to a number, not a {kind}; inside is {inside}")
    return _replace_children(part, changes) if changes else part


def _children(part: object) -> dict[str, Any]:
    if dataclasses.is_dataclass(part):
        return {f.name: getattr(part, f.name) for f in dataclasses.fields(part) if f.init}
    if isinstance(part, Mapping):
        return dict(part)
    if isinstance(part, list | tuple):
        return {str(position): item for position, item in enumerate(part)}
    return {}


def _replace_children(part: Any, changes: dict[str, Any]) -> Any:
    if dataclasses.is_dataclass(part):
        return dataclasses.replace(part, **changes)  # type: ignore[type-var]
    if isinstance(part, Mapping):
        return {**part, **changes}
    return type(part)(changes.get(str(position), item) for position, item in enumerate(part))


def check_genes(genes: Mapping[str, Gene], parts: Mapping[str, object]) -> None:
    """Try the ends of the ranges together before a run starts: what is valid alone may not be.

    ``parts`` are named as the keys begin: ``{"controller": ..., "robot": ..., "design": ...}``.

    Raises:
        InputError: a key leads nowhere, or a part refuses a combination.
    """
    for corner in corners(len(genes)):
        values = dict(zip(genes, corner, strict=True))
        try:
            replace_values(
                parts, {gene.key: gene.value(values[name]) for name, gene in genes.items()}
            )
        except InputError as error:
            at = ", ".join(f"{name} at {('low', 'high')[int(end)]}" for name, end in values.items())
            raise InputError(f"design.genes, {at}: {error}") from None


def corners(count: int) -> Iterator[tuple[float, ...]]:
    """Combinations of low (0) and high (1) of so many genes: all of them where they are few.

    Where they are many, all at one end, and each gene alone at the other.
    """
    if count <= FEW:
        yield from product((0.0, 1.0), repeat=count)
        return
    for end in (0.0, 1.0):
        yield (end,) * count
        for i in range(count):
            yield tuple(1.0 - end if i == j else end for j in range(count))
