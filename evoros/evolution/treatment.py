"""The rule for the name of a treatment and its factor levels."""

from collections.abc import Mapping
from typing import Any

from evoros.base.checks import NAME, Rule

RESERVED = ("run", "treatment", "seed")
"""Names of the first columns of tables, which no factor may have."""
MAX_LENGTH = 60  # characters of a name or a level


def describe_problem(given: Mapping[Any, Any]) -> str:
    """Describe the first fault of a treatment's name or factors; '' if there is none."""
    for key, value in given.items():
        if not NAME.holds(key) or key in RESERVED:
            return f"{key!r} must be {NAME.text}, and not one of {', '.join(RESERVED)}"
        name = key == "name"
        if value is None:
            continue
        fits = isinstance(value, str) if name else isinstance(value, str | int | float)
        text = str(value)
        if not fits or not text.strip() or len(text) > MAX_LENGTH or not text.isprintable():
            kind = "a string" if name else "a string or a number"
            return f"{key} must be {kind} of 1 to {MAX_LENGTH} characters in a line, not {value!r}"
    return ""


TREATMENT = Rule(
    f"a mapping of name and factors to strings or numbers of at most {MAX_LENGTH} characters, with "
    f"no factor called {', '.join(RESERVED)}",
    lambda value: isinstance(value, Mapping) and not describe_problem(value),
    plain=True,
)
