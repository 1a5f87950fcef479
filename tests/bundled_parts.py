"""The parts that the configuration names, for suites that check all parts of a group."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any

import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from evoros.files.resources import bundled_folder

BadValues = Mapping[str, Sequence[Mapping[str, Any]]]


def kinds(group: str) -> list[str]:
    """The choices of a configuration group."""
    return sorted(path.stem for path in bundled_folder("conf").glob(f"{group}/*.yaml"))


@cache
def configured(group: str, choice: str, *overrides: str) -> Any:
    """The part of a choice, with overrides of its keys; frozen, and therefore shared."""
    with initialize_config_dir(str(bundled_folder("conf").resolve()), version_base="1.3"):
        chosen = compose(overrides=[f"+{group}={choice}", *overrides])
    return instantiate(chosen, _convert_="all")[group]


def every(
    group: str,
    choices: Iterable[str] = (),
    bad_values: BadValues | None = None,
    overrides: Mapping[str, Sequence[str]] | None = None,
) -> Any:
    """A fixture for a suite: run it on all choices of a group, or on those named."""

    @pytest.fixture(autouse=True, params=list(choices) or kinds(group))
    def choose(self: Any, request: pytest.FixtureRequest) -> None:
        self.part = configured(group, request.param, *(overrides or {}).get(request.param, ()))
        self.bad_values = (bad_values or {}).get(request.param, ())

    return choose
