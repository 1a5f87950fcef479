"""Genes from 0 to 1, and the configured values that they replace."""

import dataclasses
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Annotated, Any, TypeVar

from evoros.base import checks
from evoros.base.errors import InputError

Part = TypeVar("Part")
BOUNDS = ("low", "high")  # configuration keys of a gene's bounds

# Values of a robot may evolve only if no file sets them. If worlds, failures or the simulator
# evolved, the test would become easier instead of the robot better.
EVOLVABLE = (
    "controller.",
    "design.sensors.",
    "robot.drive.max_speed_mps",
    "robot.drive.steering_limit_rad",
)
MAX_EXHAUSTIVE = 10  # maximum number n of genes to try all 2^n combinations of bounds (0.5 s)
_PERIOD = r"controller\.period_s|design\.sensors\.[^.]+\.period_s"
_UNFIT = {
    _PERIOD: "must be a key other than a period (periods must be multiples of the time step)",
    r"design\.sensors\.[^.]+\.(\w+_)?price": "must be a key other than a price (evolution would "
    "only lower the price)",
}


@dataclass(frozen=True)
@checks.checked
class Gene:
    """An evolved value: the dotted key of a number in the configuration, and its range.

    The key starts with one of ``EVOLVABLE``, and is neither a price nor a period of the controller
    or a sensor. Genes with the same ``group`` are inherited together.
    """

    key: Annotated[str, checks.TEXT]
    low: Annotated[float, checks.NUMBER]
    high: Annotated[float, checks.NUMBER]
    whole: Annotated[bool, checks.FLAG] = False  # only whole numbers, including both bounds
    group: Annotated[str | None, checks.TEXT] = None  # None: inherited independently of other genes

    def __post_init__(self) -> None:
        if not self.key.startswith(EVOLVABLE) or not all(self.key.split(".")):
            rule = f"must be a dotted key that starts with {' or '.join(EVOLVABLE)}"
            fix = "choose one of these keys; worlds, failures and the simulator cannot evolve"
            raise checks.invalid(self, "key", self.key, rule, fix)
        for pattern, rule in _UNFIT.items():
            if re.fullmatch(pattern, self.key):
                raise checks.invalid(self, "key", self.key, rule, "choose another key")
        if self.high < self.low:
            raise checks.invalid(self, "high", self.high, f"must be at least low ({self.low})")
        if self.whole and not (checks.is_whole(self.low) and checks.is_whole(self.high)):
            rule = "low and high must be integers if whole is true"
            raise checks.invalid(self, "whole", [self.low, self.high], rule)

    def value(self, gene: float) -> float:
        """Return the value at ``gene`` (0..1), an integer if ``whole``."""
        if self.whole:
            return self.low + checks.pick_index(gene, int(self.high - self.low) + 1)
        return checks.scale(gene, float(self.low), float(self.high))


def check_gene_names(design: object, names: Iterable[str]) -> None:
    """Raise an InputError if a gene cannot have a table column next to the sensor columns."""
    for name in names:
        if not checks.NAME.holds(name):
            rule = f"each name must be {checks.NAME.text}"
            raise checks.invalid(design, "genes", name, rule, "rename it")
        if re.match(r"number$|sensor\d+_", name):
            rule = "must differ from the names of sensor columns"
            raise checks.invalid(design, "genes", name, rule, "choose another name")


def group_genes(genes: Mapping[str, Gene]) -> dict[str, list[str]]:
    """Return the names of varying genes by group; a gene without a group forms its own."""
    groups: dict[str, list[str]] = {}
    for name, gene in genes.items():
        if gene.low < gene.high:
            groups.setdefault(gene.group or name, []).append(name)
    return groups


def replace_values(part: Part, values: Mapping[str, float], at: str = "") -> Part:
    """Return a copy of ``part`` with the number at each dotted path replaced.

    A path leads through dataclass fields, mapping keys and list positions; each dataclass on it is
    validated again. ``at`` is the path of ``part``, for messages.
    """
    by_child: dict[str, dict[str, float]] = {}
    for path, value in values.items():
        name, _, inner_path = path.partition(".")
        by_child.setdefault(name, {})[inner_path] = value
    children = _children(part)
    changes: dict[str, Any] = {}
    for name, inner_values in by_child.items():
        full_path = f"{at}.{name}" if at else name
        if name not in children:
            choices = f"{at or 'the root'} has {', '.join(children) or 'no values'}"
            raise InputError(f"{full_path}: must be the path of an existing value; {choices}")
        child = children[name]
        if set(inner_values) != {""}:
            changes[name] = replace_values(child, inner_values, full_path)
        elif checks.is_number(child):
            changes[name] = inner_values[""]
        else:
            inside = f"it contains {', '.join(_children(child)) or 'nothing'}"
            rule = f"must be the path of a number, not of a {type(child).__name__}"
            raise InputError(f"{full_path}: {rule}; {inside}")
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
    """Check combinations of bounds, which may conflict; ``parts`` is keyed by group."""
    for corner in enumerate_corners(len(genes)):
        values = dict(zip(genes, corner, strict=True))
        try:
            changed = {gene.key: gene.value(values[name]) for name, gene in genes.items()}
            replace_values(parts, changed)
        except InputError as error:
            for name, end in values.items():
                _check_bound(name, genes[name], end, parts)
            bounds = (f"{name} at {BOUNDS[int(end)]}" for name, end in values.items())
            raise InputError(f"design.genes, {', '.join(bounds)}: {error}") from None


def _check_bound(name: str, gene: Gene, end: float, parts: Mapping[str, object]) -> None:
    refusals = {place: _refuse(gene, place, parts) for place in (end, 1.0 - end)}
    if refusals[end] and refusals[1.0 - end]:  # both bounds fail, so the key may be wrong
        raise InputError(f"design.genes.{name}: {refusals[end]}")
    if refusals[end]:
        place = f"design.genes.{name}.{BOUNDS[int(end)]}"
        raise InputError(f"{place}: {gene.key} cannot be {gene.value(end):g} ({refusals[end]})")


def _refuse(gene: Gene, end: float, parts: Mapping[str, object]) -> str:
    try:
        replace_values(parts, {gene.key: gene.value(end)})
    except InputError as error:
        return str(error)
    return ""


def enumerate_corners(count: int) -> Iterator[tuple[float, ...]]:
    """Yield combinations of bounds, 0 (low) or 1 (high); with many genes, at most one differs."""
    if count <= MAX_EXHAUSTIVE:
        yield from product((0.0, 1.0), repeat=count)
        return
    for end in (0.0, 1.0):
        yield (end,) * count
        for i in range(count):
            yield tuple(1.0 - end if i == j else end for j in range(count))
