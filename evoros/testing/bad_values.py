"""Values that the fields of a description must refuse, and the line that it must answer with."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields, replace
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from evoros.base.checks import Rule, list_rules, quote
from evoros.base.errors import InputError

CANDIDATES: tuple[Any, ...] = (
    math.nan, math.inf, -math.inf, -1, -1.0, 0, 2.5, True, None, "", "wrong", [], ["wrong"], {},
    {"name": "wrong"}, object(),
)  # fmt: skip


def list_bad_values(part: Any) -> Iterator[dict[str, Any]]:
    """Yield a value for each field and rule that the rule forbids, and NaN for plain numbers."""
    settable = {field.name for field in fields(part) if field.init}
    ruled = {name: (rule, optional) for name, rule, optional in list_rules(type(part))}
    for name, (rule, optional) in ruled.items():
        if name in settable:
            yield from (
                {name: value}
                for value in CANDIDATES
                if not (_holds(rule, value) or (optional and value is None))
            )
    for name, hint in get_type_hints(type(part)).items():
        if name in settable and name not in ruled and _is_number(hint):
            yield from ({name: value} for value in (math.nan, "wrong"))


def _holds(rule: Rule, value: Any) -> bool:
    try:
        return bool(rule.holds(value))
    except Exception:  # then the constructor fails in the same way, which the check reports
        return False


def _is_number(hint: Any) -> bool:
    kinds = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    return any(kind in (int, float) for kind in kinds)


def find_problem(part: Any, values: Mapping[str, Any]) -> str:
    """Return how a description answers wrongly to bad values; an empty text if it refuses them."""
    given = ", ".join(f"{name}={quote(value)}" for name, value in values.items())
    call = f"{type(part).__name__}({given})"
    try:
        replace(part, **values)
    except InputError as error:
        message = str(error)
        if "\n" in message:
            return f"{call} must be refused in one line, not {message!r}"
        if not any(f"{field.name}: must" in message for field in fields(part)):
            return f"{call} must be refused by a line with FIELD: must, not {message!r}"
        if not any(quote(value) in message for value in _pieces(values)):
            return f"{call} must be refused by a line that quotes the value, not {message!r}"
        return ""
    except Exception as error:
        return f"{call} must raise InputError, not {error!r}"
    return f"{call} must raise InputError; is `@checked` below `@dataclass`, with a rule a field?"


def _pieces(values: Mapping[str, Any]) -> Iterator[Any]:
    for value in values.values():
        yield value
        if isinstance(value, list | tuple):
            yield from value
