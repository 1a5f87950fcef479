"""Rules for the fields of descriptions, declared beside each field and checked at construction.

A description is a frozen dataclass. ``checked`` makes its constructor check every field that is
annotated with a rule::

    @dataclass(frozen=True)
    @checked
    class Delay:
        delay_s: Annotated[float, NOT_NEGATIVE] = 0.2
"""

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from numbers import Real
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from evoros.base.errors import InputError

T = TypeVar("T")

MAX_VALUE_LENGTH = 80
"""The number of characters that an error message quotes of a value."""


LARGEST = 1e9
"""The greatest size of numbers: beyond lie slips of the keyboard."""
MOST = 1_000_000
"""The greatest count of anything."""
LEAST_STEP_S = 1e-5
"""The minimum time step of a simulation [s]: with shorter ones, nothing would seem to move."""


@dataclass(frozen=True)
class Rule:
    """A condition on one value, and its wording.

    The numbers in the value must also be at most ``limit`` in size.
    """

    text: str  # completes "must be ..."
    holds: Callable[[Any], bool]
    plain: bool = False  # of texts and numbers, which no class builds
    limit: float = LARGEST


def checked(cls: type[T]) -> type[T]:
    """Decorate a dataclass, below ``@dataclass``, so that its constructor checks its fields.

    Each field ``Annotated[T, RULE]`` must keep its rule; a field ``Annotated[T | None, RULE]`` may
    also be None. The class's own ``__post_init__`` runs afterwards and is left with the checks
    that involve several fields.

    The constructor raises InputError, which names the class, the field, the rule and the value.
    """
    check_together: Callable[[T], None] | None = getattr(cls, "__post_init__", None)

    @cache
    def rules() -> tuple[tuple[str, Rule, bool], ...]:
        return tuple(list_rules(cls))  # not yet known when the class is decorated

    def __post_init__(self: T) -> None:  # noqa: N807 - dataclass calls it by this name
        for name, rule, optional in rules():
            value = getattr(self, name)
            if not (rule.holds(value) or (optional and value is None)):
                fix = "" if rule.plain else _missing_target(value)
                raise invalid(self, name, value, f"must be {rule.text}", fix)
            for amount in _list_numbers(value):
                if abs(amount) > rule.limit:
                    raise invalid(self, name, amount, f"must be at most {rule.limit:g}")
        if check_together is not None:
            check_together(self)

    cls.__post_init__ = __post_init__  # type: ignore[attr-defined]
    return cls


def _list_numbers(value: object) -> Iterator[float]:
    """Yield the finite numbers in a value that a configuration can have."""
    if is_number(value):
        yield value  # type: ignore[misc]
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _list_numbers(item)


def list_rules(cls: type) -> Iterator[tuple[str, Rule, bool]]:
    """Yield (field, rule, may be None) for every rule in the annotations of a class."""
    for name, hint in get_type_hints(cls, include_extras=True).items():
        if get_origin(hint) is Annotated:
            optional = type(None) in get_args(hint.__origin__)
            for rule in hint.__metadata__:
                if isinstance(rule, Rule):
                    yield name, rule, optional


def is_number(value: object) -> bool:
    """Whether a value is a finite real number; True and False are not numbers here."""
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def is_whole(value: object) -> bool:
    """Whether a value is an integer; True and False are not numbers here."""
    return isinstance(value, int) and not isinstance(value, bool)


NUMBER = Rule("a number", is_number)
POSITIVE = Rule("a number greater than 0", lambda v: is_number(v) and v > 0)
NOT_NEGATIVE = Rule("a number of at least 0", lambda v: is_number(v) and v >= 0)
PROBABILITY = Rule("a number from 0 to 1", lambda v: is_number(v) and 0 <= v <= 1)
COUNT = Rule("a whole number of at least 1", lambda v: is_whole(v) and v >= 1, limit=MOST)
WHOLE = Rule("a whole number of at least 0", lambda v: is_whole(v) and v >= 0, limit=MOST)
SEED = replace(WHOLE, limit=2**63 - 1)
TEXT = Rule("a text that is not empty", lambda v: isinstance(v, str) and bool(v.strip()))
NAME = Rule(  # for names of columns and files
    "a name of letters, digits, - and _",
    lambda v: isinstance(v, str) and re.fullmatch(r"[A-Za-z0-9_-]+", v) is not None,
)
NOT_NEGATIVES = Rule(
    "a list of numbers of at least 0",
    lambda v: isinstance(v, list | tuple) and len(v) > 0 and all(map(NOT_NEGATIVE.holds, v)),
)
FLAG = Rule("true or false", lambda v: isinstance(v, bool))


def number_between(low: float, high: float) -> Rule:
    """Require a number of at least ``low`` and at most ``high``."""
    return Rule(f"a number from {low:g} to {high:g}", lambda v: is_number(v) and low <= v <= high)


def one_of(*choices: str) -> Rule:
    """Require one of the given texts."""
    return Rule("one of " + ", ".join(choices), lambda v: v in choices)


def instance_of(kind: Any, what: str) -> Rule:
    """Require an instance of a class or runtime-checkable protocol; ``what`` names it."""
    return Rule(what, lambda v: isinstance(v, kind))


def sequence_of(kind: Any, what: str) -> Rule:
    """Require a list or tuple of instances of ``kind``; ``what`` is their plural."""
    return Rule(
        f"a list of {what}",
        lambda v: isinstance(v, list | tuple) and all(isinstance(item, kind) for item in v),
    )


def mapping_of(kind: Any, what: str) -> Rule:
    """Require a mapping whose values are instances of ``kind``; ``what`` is their plural."""
    return Rule(
        f"a mapping from names to {what}",
        lambda v: hasattr(v, "values") and all(isinstance(item, kind) for item in v.values()),
        plain=kind is str,
    )


def check_order(part: object, low: str, high: str) -> None:
    """Hold the field ``low`` to at most the field ``high``; for ``__post_init__``.

    Raises:
        InputError: ``low`` is greater.
    """
    minimum, maximum = getattr(part, low), getattr(part, high)
    if minimum > maximum:
        raise invalid(part, low, minimum, f"must be at most {high} ({maximum})")


def invalid(part: object, field: str, value: object, rule: str, fix: str = "") -> InputError:
    """Return the error for one field of a description; the caller raises it."""
    default = getattr(type(part), field, None)
    if not fix:
        known = isinstance(default, int | float | str) and default != value
        example = f", for example {default}" if known else ""
        fix = f"set it to such a value{example}"
    return InputError(f"{type(part).__name__}.{field}: {rule}, not {quote(value)}; {fix}")


def _missing_target(value: object) -> str:
    """Return the fix for keys that were given for a part (or for several) without its class."""
    several = isinstance(value, dict) and any(isinstance(item, dict) for item in value.values())
    single = isinstance(value, dict) and not any(hasattr(i, "__dict__") for i in value.values())
    fix = "add _target_, the class to build from these keys"
    return fix if value and (several or single) else ""


def quote(value: object) -> str:
    """Return the value on one line, shortened: a world's representation has many kilobytes."""
    text = " ".join(repr(value).split())
    return text if len(text) <= MAX_VALUE_LENGTH else f"{text[: MAX_VALUE_LENGTH - 3]}..."
