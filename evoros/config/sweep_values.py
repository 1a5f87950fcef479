"""The values of a sweep: what an override in Hydra's grammar of sweeps stands for.

Every form either gives values or is refused in one line.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import (
    ChoiceSweep,
    Glob,
    Override,
    RangeSweep,
    Sweep,
)

from evoros.base.errors import InputError
from evoros.config.compose import quote

MOST = 100_000
"""Jobs of a sweep: more are a slip of the hand, such as a range() with one zero too many."""
ListChoices = Callable[[str], Sequence[str]]
"""Returns the names of the files of a group; none if there is no such group."""


def expand_values(override: Override, list_choices: ListChoices) -> list[str]:
    """Return the override once for each value that it sweeps over, or as it is if it does not.

    Raises:
        InputError: it stands for no values, or for more than a sweep can have.
    """
    typed, key = override.input_line or "", override.get_key_element()
    if not override.is_sweep_override():
        return [typed]
    if override.is_hydra_override():
        raise _refuse(typed, "must have one value, because all jobs share it; write that value")
    if override.is_delete():
        raise _refuse(typed, f"removes a key, which has no values to sweep over; write {key}")
    swept = override.value()
    if isinstance(swept, Glob):
        values = _match(swept, override, list_choices)
    elif not override.is_discrete_sweep():
        raise _refuse(
            typed,
            "must be a list of values or a range(), because only a sweeper can choose from an "
            "interval(); write the values, or choose one (hydra/sweeper=optuna)",
        )
    else:
        _check_values(typed, swept)
        values = [_write(value) for value in override.sweep_iterator()]
    if not values:
        raise _refuse(typed, "must have values to sweep over, not none; give one")
    return [f"{key}={value}" for value in values]


def _write(value: Any) -> str:
    """Write a value in the grammar, so that it is read as the same: the text ``1`` gets quotes."""
    text = Override._get_value_element_as_str(value)
    if isinstance(value, str):
        read = OverridesParser.create().parse_override(f"key={text}").value()
        return text if read == value else quote(value)
    return text


def check_number(counts: Sequence[int]) -> None:
    """Require that the product of the numbers of values is no slip of the hand.

    Raises:
        InputError: it is more than ``MOST``.
    """
    if math.prod(counts) > MOST:
        raise InputError(
            f"the sweep: must have at most {MOST} jobs, not {math.prod(counts)}; sweep over fewer "
            f"values"
        )


def _match(glob: Glob, override: Override, list_choices: ListChoices) -> list[str]:
    """Return the choices of a group that a pattern matches."""
    typed, group = override.input_line or "", override.key_or_group
    choices = list_choices(group)
    if not choices:
        raise _refuse(
            typed, f"glob() chooses files of a group, and {group} is none; write the values"
        )
    found = glob.filter(list(choices))
    if not found:
        raise _refuse(
            typed, f"must match a choice of {group} ({', '.join(choices)}); correct the pattern"
        )
    return found


def _check_values(typed: str, swept: object) -> None:
    if isinstance(swept, ChoiceSweep):
        if any(isinstance(value, Sweep | Glob) for value in swept.list):
            raise _refuse(typed, "must not have a sweep inside another; write all values in one")
    elif isinstance(swept, RangeSweep):
        count = _count(swept)
        if not math.isfinite(count):
            raise _refuse(
                typed, "range() must have finite ends and a step other than 0; correct them"
            )
        if count > MOST:
            raise _refuse(typed, f"must have at most {MOST} values; choose a larger step")


def _count(swept: RangeSweep) -> float:
    """Return about how many values a range has; infinite if it never ends."""
    start, stop, step = (float(value or 0) for value in (swept.start, swept.stop, swept.step))
    if not all(map(math.isfinite, (start, stop, step))) or step == 0:
        return math.inf
    return max(0.0, (stop - start) / step)


def _refuse(typed: str, why: str) -> InputError:
    return InputError(f"{typed}: {why}")
