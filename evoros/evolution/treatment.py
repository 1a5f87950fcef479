"""The rule for the name and factor levels of a treatment."""

from collections.abc import Mapping
from typing import Any

from evoros.base.checks import NAME, Rule

RESERVED = ("run", "treatment", "seed")  # names of the first columns of tables
MAX_LENGTH = 60  # maximum number of characters of a name or level


def describe_problem(given: Mapping[Any, Any]) -> str:
    """Describe the first fault in the name or factors of a treatment; '' if there is none."""
    for key, value in given.items():
        if not NAME.holds(key) or key in RESERVED:
            return f"{key!r} must be {NAME.text} other than {', '.join(RESERVED)}"
        name = key == "name"
        if value is None:
            continue
        fits = isinstance(value, str) if name else isinstance(value, str | int | float)
        text = str(value)
        if not fits or not text.strip() or len(text) > MAX_LENGTH or not text.isprintable():
            kind = "a string" if name else "a string or a number"
            return (
                f"{key} must be {kind} of 1 to {MAX_LENGTH} characters on one line, not {value!r}"
            )
    return ""


TREATMENT = Rule(
    f"a mapping from 'name' and the names of factors to strings or numbers of at most {MAX_LENGTH} "
    f"characters, with no factor called {' or '.join(RESERVED)}",
    lambda value: isinstance(value, Mapping) and not describe_problem(value),
    plain=True,
)
