"""Rules for fields of descriptions, declared with the field and checked at construction.

A description is a frozen dataclass. ``checked`` makes the constructor check every field that is
annotated with a rule::

    @dataclass(frozen=True)
    @checked
    class Delay:
        delay_s: Annotated[float, NOT_NEGATIVE] = 0.2
"""

import math
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from numbers import Integral, Real
from typing import Annotated, Any, TypeAlias, TypeVar, get_args, get_origin, get_type_hints

from evoros.base.errors import InputError, PartFault

Interval: TypeAlias = float | Sequence[float]  # a number, or [low, high]
T = TypeVar("T")

MAX_VALUE_LENGTH = 80  # maximum length of a value quoted in an error message
LARGEST = 1e9  # maximum magnitude of a number, to detect typing errors
MOST = 1_000_000  # maximum count
LEAST_STEP_S = 1e-5  # minimum time step of a simulation, below which rounding removes motion


@dataclass(frozen=True)
class Rule:
    """A condition on a value; numbers in the value must not exceed ``limit`` in magnitude."""

    text: str  # completes "must be ..."
    holds: Callable[[Any], bool]
    plain: bool = False  # whether values have no class, such as strings
    limit: float = LARGEST


def checked(cls: type[T]) -> type[T]:
    """Decorate a dataclass, below ``@dataclass``, to check its fields in the constructor.

    Each field ``Annotated[T, RULE]`` must satisfy its rule; a field ``Annotated[T | None, RULE]``
    may also be None. The ``__post_init__`` of the class runs afterwards.
    """
    check_together: Callable[[T], None] | None = getattr(cls, "__post_init__", None)

    @cache
    def rules() -> tuple[tuple[str, Rule, bool], ...]:
        return tuple(list_rules(cls))  # type hints can be resolved only once the class is complete

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
    if is_number(value):
        yield value  # type: ignore[misc]
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _list_numbers(item)


def list_rules(cls: type) -> Iterator[tuple[str, Rule, bool]]:
    """Yield (field, rule, True if the field may be None) for each annotated field of a class."""
    for name, hint in get_type_hints(cls, include_extras=True).items():
        if get_origin(hint) is Annotated:
            optional = type(None) in get_args(hint.__origin__)
            for rule in hint.__metadata__:
                if isinstance(rule, Rule):
                    yield name, rule, optional


def is_number(value: object) -> bool:
    """Return True for a finite real number that is not a Boolean."""
    try:
        return is_real(value) and math.isfinite(value)  # type: ignore[arg-type]
    except OverflowError:  # an int too large for float
        return False


def is_real(value: object) -> bool:
    """Return True for a real number, finite or not, that is not a Boolean."""
    return isinstance(value, Real) and not isinstance(value, bool)


def is_whole(value: object) -> bool:
    """Return True for an integer, including numpy types, that is not a Boolean."""
    return isinstance(value, Integral) and not isinstance(value, bool)


NUMBER = Rule("a number", is_number)
POSITIVE = Rule("a positive number", lambda v: is_number(v) and v > 0)
NOT_NEGATIVE = Rule("a non-negative number", lambda v: is_number(v) and v >= 0)
FRACTION = Rule("a number greater than 0 and at most 1", lambda v: is_number(v) and 0 < v <= 1)
PROBABILITY = Rule("a number from 0 to 1", lambda v: is_number(v) and 0 <= v <= 1)
COUNT = Rule("a positive integer", lambda v: is_whole(v) and v >= 1, limit=MOST)
WHOLE = Rule("a non-negative integer", lambda v: is_whole(v) and v >= 0, limit=MOST)
SEED = replace(WHOLE, limit=2**63 - 1)
TEXT = Rule("a non-empty string", lambda v: isinstance(v, str) and bool(v.strip()))
NAME = Rule(  # valid as a column or file name
    "a name of letters, digits, - and _",
    lambda v: isinstance(v, str) and re.fullmatch(r"[A-Za-z0-9_-]+", v) is not None,
)
NOT_NEGATIVES = Rule(
    "a non-empty list of non-negative numbers",
    lambda v: isinstance(v, list | tuple) and len(v) > 0 and all(map(NOT_NEGATIVE.holds, v)),
)
SCORE = Rule(  # small enough to prevent overflow of squares and sums
    "a finite number with a magnitude of at most 1e100",
    lambda v: is_number(v) and abs(float(v)) <= 1e100,
)
FLAG = Rule("true or false", lambda v: isinstance(v, bool))


def number_between(low: float, high: float) -> Rule:
    """Return the rule for a number from ``low`` to ``high``."""
    return Rule(f"a number from {low:g} to {high:g}", lambda v: is_number(v) and low <= v <= high)


def one_of(*choices: str) -> Rule:
    """Return the rule for one of the given strings."""
    return Rule("one of " + ", ".join(choices), lambda v: isinstance(v, str) and v in choices)


def instance_of(kind: Any, what: str) -> Rule:
    """Return the rule for an instance of a class or protocol, described by ``what``."""
    return Rule(what, lambda v: isinstance(v, kind))


def sequence_of(kind: Any, what: str) -> Rule:
    """Return the rule for a list or tuple of ``kind``; ``what`` is the plural noun for it."""
    return Rule(
        f"a list of {what}",
        lambda v: isinstance(v, list | tuple) and all(isinstance(item, kind) for item in v),
    )


def mapping_of(kind: Any, what: str) -> Rule:
    """Return the rule for a mapping to ``kind``; ``what`` is the plural noun for it."""
    return Rule(
        f"a mapping from names to {what}",
        lambda v: hasattr(v, "values") and all(isinstance(item, kind) for item in v.values()),
        plain=kind is str,
    )


A_CONTEXT = Rule("a context manager", lambda v: hasattr(v, "__enter__") and hasattr(v, "__exit__"))


def ask(key: str, method: Callable[..., Any], rule: Rule, *arguments: Any) -> Any:
    """Call a method of the part at configuration key ``key``, and check the return value."""
    return check_answer(key, method, rule, method(*arguments))


def check_answer(key: str, method: Callable[..., Any], rule: Rule, answer: Any) -> Any:
    """Check and return ``answer``, which a method of the part at ``key`` has returned."""
    if rule.holds(answer):
        return answer
    part = getattr(method, "__self__", None)
    name = method.__qualname__ if part is None else f"{type(part).__name__}.{method.__name__}"
    raise PartFault(
        f"{f'{key}: ' if key else ''}{name} must return {rule.text}, not {quote(answer)}; correct "
        f"{find_source(method)}"
    )


def find_source(definition: Any) -> str:
    """Return the source file of a class or function, for a message."""
    module = sys.modules.get(getattr(definition, "__module__", ""))
    return getattr(module, "__file__", None) or "it"


def require(part: object, rules: Mapping[str, Rule]) -> None:
    """Check the attributes of a part against rules."""
    for name, rule in rules.items():
        value = getattr(part, name, None)
        if not rule.holds(value):
            typed = name in getattr(part, "__dataclass_fields__", ())
            fix = "" if typed else f"correct {find_source(type(part))}"
            raise invalid(part, name, value, f"must be {rule.text}", fix)


def check_order(part: object, low: str, high: str) -> None:
    """Check that the field ``low`` is at most the field ``high``."""
    minimum, maximum = getattr(part, low), getattr(part, high)
    if minimum > maximum:
        raise invalid(part, low, minimum, f"must be at most {high} ({maximum})")


def invalid(part: object, field: str, value: object, rule: str, fix: str = "") -> InputError:
    """Return the error for a field of a description."""
    default = getattr(type(part), field, None)
    if not fix and isinstance(default, int | float | str) and default != value:
        fix = f"for example, set it to {default}"
    message = f"{type(part).__name__}.{field}: {rule}, not {quote(value)}"
    return InputError(f"{message}; {fix}" if fix else message)


def _missing_target(value: object) -> str:
    """Return how to fix a part configured without a class; empty if it has a class."""
    several = isinstance(value, dict) and any(isinstance(item, dict) for item in value.values())
    single = isinstance(value, dict) and not any(hasattr(i, "__dict__") for i in value.values())
    fix = "add _target_ with the class that accepts these keys"
    return fix if value and (several or single) else ""


def quote(value: object) -> str:
    """Return a representation of a value on one line, shortened if long."""
    # the default representation contains the address of the object
    kind, plain = type(value), type(value).__repr__ is object.__repr__
    text = f"an object of {kind.__module__}.{kind.__qualname__}" if plain else repr(value)
    text = " ".join(text.split())
    return text if len(text) <= MAX_VALUE_LENGTH else f"{text[: MAX_VALUE_LENGTH - 3]}..."


def _is_interval(value: object) -> bool:
    pair = isinstance(value, list | tuple) and len(value) == 2 and all(map(is_number, value))
    return is_number(value) or (pair and value[0] <= value[1])  # type: ignore[index]


INTERVAL = Rule("a number, or [low, high] with low <= high", _is_interval)


def bounds(interval: Any) -> tuple[float, float]:
    """Return the minimum and maximum of a configured interval."""
    low, high = (interval, interval) if is_number(interval) else interval
    return float(low), float(high)


def scale(gene: float, low: float, high: float) -> float:
    """Return the value at ``gene`` (0..1) between ``low`` and ``high``, clipped to these."""
    return min(max(low + gene * (high - low), low), high)


def pick_index(gene: float, count: int) -> int:
    """Return the index from 0 to count - 1 at ``gene`` (0..1); indices have equal shares."""
    return min(int(gene * count), count - 1)


def null_or_whole(minimum: int) -> Rule:
    """Return the rule for null or an integer of at least ``minimum``."""
    return Rule(
        f"an integer >= {minimum}, or null",
        lambda v: v is None or (is_whole(v) and v >= minimum),
        limit=MOST,
    )
