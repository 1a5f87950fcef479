"""Rules for the fields of descriptions, and the check that applies them."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from typing import Any

from evoros.base.errors import InputError

LONGEST = 80
"""Characters of a value in a message."""


@dataclass(frozen=True)
class Rule:
    """A condition on one value, and how to say it."""

    text: str  # completes "must be ..."
    holds: Callable[[Any], bool]


def is_number(value: object) -> bool:
    """A finite real number; True and False are not numbers here."""
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def is_whole(value: object) -> bool:
    """An integer; True and False are not numbers here."""
    return isinstance(value, int) and not isinstance(value, bool)


NUMBER = Rule("a number", is_number)
POSITIVE = Rule("a number greater than 0", lambda v: is_number(v) and v > 0)
NOT_NEGATIVE = Rule("a number of at least 0", lambda v: is_number(v) and v >= 0)
PROBABILITY = Rule("a number from 0 to 1", lambda v: is_number(v) and 0 <= v <= 1)
COUNT = Rule("a whole number of at least 1", lambda v: is_whole(v) and v >= 1)
WHOLE = Rule("a whole number of at least 0", lambda v: is_whole(v) and v >= 0)
TEXT = Rule("a text that is not empty", lambda v: isinstance(v, str) and bool(v.strip()))
NAME = Rule(  # of what becomes the name of a column or a file
    "a name of letters, digits, - and _",
    lambda v: isinstance(v, str) and re.fullmatch(r"[A-Za-z0-9_-]+", v) is not None,
)
FLAG = Rule("true or false", lambda v: isinstance(v, bool))


def one_of(*choices: str) -> Rule:
    """One of the given texts."""
    return Rule("one of " + ", ".join(choices), lambda v: v in choices)


def instance_of(kind: Any, what: str) -> Rule:
    """``kind`` is a class or a runtime-checkable protocol; ``what`` completes "must be ..."."""
    return Rule(what, lambda v: isinstance(v, kind))


def sequence_of(kind: Any, what: str) -> Rule:
    """A list or tuple of instances; ``what`` completes "a list of ..."."""
    return Rule(
        f"a list of {what}",
        lambda v: isinstance(v, list | tuple) and all(isinstance(item, kind) for item in v),
    )


def mapping_of(kind: Any, what: str) -> Rule:
    """A mapping whose values are instances; ``what`` is their plural."""
    return Rule(
        f"a mapping from names to {what}",
        lambda v: hasattr(v, "values") and all(isinstance(item, kind) for item in v.values()),
    )


def check(part: object, **rules: Rule) -> None:
    """Hold each named field of ``part`` against its rule.

    Raises:
        InputError: names the class, the field, the rule and the value.
    """
    for name, rule in rules.items():
        value = getattr(part, name)
        if not rule.holds(value):
            raise invalid(part, name, value, f"must be {rule.text}", _forgotten(value))


def invalid(part: object, field: str, value: object, rule: str, cure: str = "") -> InputError:
    """The error for one field of a description, to be raised by the caller."""
    default = getattr(type(part), field, None)
    if not cure and isinstance(default, int | float | str):
        cure = f"set it to such a value, for example {default}"
    cure = f"; {cure}" if cure else "; set it to such a value"
    return InputError(f"{type(part).__name__}.{field}: {rule}, not {_short(value)}{cure}")


def _forgotten(value: object) -> str:
    """The cure where keys were given for a part, or for one of several, but no class to build."""
    several = isinstance(value, dict) and any(isinstance(each, dict) for each in value.values())
    lone = isinstance(value, dict) and not any(hasattr(each, "__dict__") for each in value.values())
    return "add _target_, the class to build from these keys" if value and (several or lone) else ""


def _short(value: object) -> str:
    """The value on one line, cut: whole worlds have representations of many kilobytes."""
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
