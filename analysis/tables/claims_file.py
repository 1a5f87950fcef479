"""Reads the user's claims from the file given to ``evoros analyze claims --claims``."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from evoros.base.checks import is_number
from evoros.base.errors import InputError

from .conditions import Conditions, read_entries, read_levels, select_rows
from .records import Record
from .study import Study

ABOVE, BELOW, WITHIN = "above", "below", "within"
KEYS = ("claim", "measure", "comparison", "threshold", "treatments", "against")
REQUIRED = ("claim", "measure", "comparison")


@dataclass(frozen=True)
class Group:
    """The treatments that a claim is about, chosen by conditions on factors or by labels."""

    conditions: Conditions
    labels: tuple[str, ...] = ()

    def select(self, study: Study, place: str) -> list[Record]:
        """Select the finished runs of these treatments."""
        unknown = [label for label in self.labels if label not in study.treatments]
        if unknown:
            raise InputError(
                f"{place}: treatment {unknown[0]!r} not found; choose among "
                f"{'; '.join(study.treatments)}"
            )
        rows = select_rows(study.records, self.conditions, place)
        return [
            record
            for record, fits in zip(study.records, rows, strict=True)
            if fits and (not self.labels or record.treatment in self.labels)
        ]

    def describe(self) -> str:
        """Describe the treatments; empty for all treatments."""
        parts = [f"{name} {' or '.join(levels)}" for name, levels in self.conditions.items()]
        return ", ".join([*self.labels, *parts]).replace("_", " ")


@dataclass(frozen=True)
class OwnClaim:
    """An entry of the claims file."""

    text: str
    measure: str
    comparison: str  # ``ABOVE``, ``BELOW`` or ``WITHIN``
    low: float  # the threshold, or the lower threshold of ``WITHIN``
    high: float
    treatments: Group
    against: Group | None  # if given, the claim is about the difference from this group
    place: str  # prefix of error messages


def read_claims(path: Path) -> list[OwnClaim]:
    """Read the claims from a YAML file."""
    entries = read_entries(path, "claims", ", ".join(REQUIRED), "- claim: ...")
    return [_read(entry, f"{path}, entry {i}") for i, entry in enumerate(entries, 1)]


def _read(entry: object, place: str) -> OwnClaim:
    if not isinstance(entry, dict):
        raise InputError(
            f"{place}: not a mapping; start it with - claim: and add keys from {', '.join(KEYS)}"
        )
    for key in entry:
        if key not in KEYS:
            raise InputError(
                f"{place}: unknown key {key!r}; remove it, or use one of {', '.join(KEYS)}"
            )
    for key in REQUIRED:
        if not isinstance(entry.get(key), str) or not entry[key].strip():
            raise InputError(f"{place}: {key} must be a string, not {entry.get(key)!r}")
    comparison = entry["comparison"]
    if comparison not in (ABOVE, BELOW, WITHIN):
        raise InputError(
            f"{place}: comparison must be one of {ABOVE}, {BELOW}, {WITHIN}, not {comparison!r}"
        )
    against = _read_group(entry["against"], f"{place}: against") if "against" in entry else None
    bounds = _read_bounds(entry.get("threshold"), comparison, against is not None, place)
    treatments = _read_group(entry.get("treatments", {}), f"{place}: treatments")
    text, measure = entry["claim"].strip(), entry["measure"].strip()
    return OwnClaim(text, measure, comparison, *bounds, treatments, against, place)


def _read_bounds(
    given: object, comparison: str, difference: bool, place: str
) -> tuple[float, float]:
    """Read one or two thresholds; a difference without a threshold is compared with 0."""
    if given is None and difference and comparison != WITHIN:
        return 0.0, 0.0
    bounds = given if comparison == WITHIN else [given, given]
    numbers = bounds if isinstance(bounds, list) and all(map(is_number, bounds)) else []
    if len(numbers) != 2 or numbers[0] > numbers[1]:
        rule = "two numbers, [low, high]" if comparison == WITHIN else "a number"
        raise InputError(f"{place}: threshold must be {rule}, not {given!r}")
    return float(numbers[0]), float(numbers[1])


def _read_group(given: object, place: str) -> Group:
    if isinstance(given, Mapping):
        return Group(read_levels(given))
    labels = [given] if isinstance(given, str) else given
    if isinstance(labels, list) and labels and all(isinstance(name, str) for name in labels):
        return Group({}, tuple(labels))
    raise InputError(
        f"{place} must map factors to levels, as in {{failure: none}}, or list treatment labels, "
        f"not {given!r}"
    )
