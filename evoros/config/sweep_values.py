"""The values that an override in Hydra's grammar of sweeps stands for.

Every form either gives values or is refused in one line.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Glob, Override, RangeSweep, Sweep

from evoros.base.errors import InputError
from evoros.config.compose import quote

MAX_JOBS = 100_000
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


def check_count(counts: Sequence[int]) -> None:
    """Require that the product of the counts of values is at most ``MAX_JOBS``."""
    if math.prod(counts) > MAX_JOBS:
        raise InputError(
            f"the sweep: must have at most {MAX_JOBS} jobs, not {math.prod(counts)}; sweep over "
            f"fewer values"
        )


def _match(glob: Glob, override: Override, list_choices: ListChoices) -> list[str]:
    """Return the choices of a group that a pattern matches."""
    typed, group = override.input_line or "", override.key_or_group
    choices = list_choices(group)
    if not choices:
        raise _refuse(
            typed, f"glob() chooses files of a group, and {group} is none; write the values"
        )
    matches = glob.filter(list(choices))
    if not matches:
        raise _refuse(
            typed, f"must match a choice of {group} ({', '.join(choices)}); correct the pattern"
        )
    return matches


def _check_values(typed: str, swept: object) -> None:
    if isinstance(swept, ChoiceSweep):
        if any(isinstance(value, Sweep | Glob) for value in swept.list):
            raise _refuse(typed, "must not have a sweep inside another; write all values in one")
    elif isinstance(swept, RangeSweep):
        start, stop, step = (float(value or 0) for value in (swept.start, swept.stop, swept.step))
        if not all(map(math.isfinite, (start, stop, step))) or step == 0:
            raise _refuse(
                typed, "range() must have finite ends and a step other than 0; correct them"
            )
        if (stop - start) / step > MAX_JOBS:
            raise _refuse(typed, f"must have at most {MAX_JOBS} values; choose a larger step")


def _refuse(typed: str, why: str) -> InputError:
    return InputError(f"{typed}: {why}")
