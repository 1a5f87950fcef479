"""The parts that the configuration names, for suites that check all parts of a group."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, fields
from functools import cache, reduce
from operator import getitem
from typing import Any, TypeVar

import pytest
from hydra import compose
from hydra.utils import instantiate

from evoros.config.compose import initialize
from evoros.files.plugins import conf_folders
from evoros.testing.part import bits

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
    return reduce(getitem, group.split("/"), instantiate(chosen, _convert_="all"))


def find_other_defaults(group: str) -> list[str]:
    """The choices named after their class's module that change a default of the class."""
    parts = {choice: configured(group, choice) for choice in kinds(group)}
    same = {choice: part for choice, part in parts.items() if _module(part) == choice}
    return [choice for choice, part in same.items() if bits(part) != bits(_with_defaults(part))]


def _module(part: object) -> str:
    return type(part).__module__.rpartition(".")[2]


def _with_defaults(part: Any) -> Any:
    needed = (one.name for one in fields(part) if one.default is one.default_factory is MISSING)
    return type(part)(**{name: getattr(part, name) for name in needed})


def every(
    group: str,
    choices: Iterable[Any] = (),
    bad_values: BadValues | None = None,
    overrides: Mapping[str, Sequence[str]] | None = None,
) -> Any:
    """A fixture for a suite: run it on all choices of a group, or on those named."""

    @pytest.fixture(autouse=True, params=list(choices) or kinds(group))
    def choose(self: Any, request: pytest.FixtureRequest) -> None:
        self.part = configured(group, request.param, *(overrides or {}).get(request.param, ()))
        self.bad_values = (bad_values or {}).get(request.param, ())

    return choose
