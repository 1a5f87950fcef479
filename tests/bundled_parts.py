"""The parts that the configuration names, for suites that check all parts of a group."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any, TypeVar

import pytest
from hydra import compose
from hydra.utils import instantiate

from evoros.config.compose import initialize
from evoros.files.plugins import conf_folders

BadValues = Mapping[str, Sequence[Mapping[str, Any]]]
T = TypeVar("T")


class ByName(Mapping[str, T]):
    """Parts by name, each made when a test asks for it, because each process lists all tests."""

    def __init__(self, names: Sequence[str], make: Callable[[str], T]) -> None:
        self._names, self._make = names, cache(make)

    def __getitem__(self, name: str) -> T:
        return self._make(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def kinds(group: str) -> list[str]:
    """The choices of a configuration group."""
    files = (file for folder in conf_folders() for file in folder.glob(f"{group}/*.yaml"))
    return sorted(file.stem for file in files)


@cache
def configured(group: str, choice: str, *overrides: str) -> Any:
    """The part of a choice, with overrides of its keys; frozen, and therefore shared."""
    with initialize():
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
