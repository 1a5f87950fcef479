"""Every number of a configuration has bounds, which are told before a run."""

import copy
from collections.abc import Iterator, Sequence
from typing import Any

import pytest

from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.config.configuration import Configuration
from evoros.preflight.preflight import preflight

BASELINE = ["simulator=planar", "world=boxes", "executor.workers=1"]
OTHERS = (
    ["simulator=pybullet", "failure=spatial"],
    ["simulator=mujoco", "controller=rover_l1"],
    ["world=generated", "optimizer=random_search"],
    ["experiment=lidar"],
    ["experiment=reckoning"],
    ["experiment=two_rovers"],
)
UNBOUNDED = ("seed",)
"""Whole numbers of 63 bits."""


def numbers(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """The numbers in a configuration, and where they are."""
    if isinstance(value, dict | list):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from numbers(item, (*path, key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path, value


def put(values: Any, path: tuple[Any, ...], value: float) -> dict[str, Any]:
    changed = copy.deepcopy(dict(values))
    inner: Any = changed
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return changed


def check_all(values: Any, paths: Sequence[tuple[Any, ...]]) -> None:
    """Let each of these numbers be far too large, to both sides."""
    given = dict(numbers(values))
    for path in paths:
        for extreme in (10**15, -(10**15)):
            value = extreme if isinstance(given[path], int) else float(extreme)
            with pytest.raises(InputError) as refusal:
                Configuration("", put(values, path, value)).build()
            assert "Error" not in str(refusal.value), path
            assert "\n" not in str(refusal.value), path


def list_paths(values: Any) -> list[tuple[Any, ...]]:
    return [path for path, _ in numbers(values) if path[-1] not in UNBOUNDED]


@pytest.mark.slow
def test_each_number_of_the_baseline_is_refused_if_it_is_far_too_large() -> None:
    values = compose(BASELINE).values
    check_all(values, list_paths(values))


@pytest.mark.slow
@pytest.mark.parametrize("chosen", OTHERS)
def test_each_number_of_other_parts_is_refused_if_it_is_far_too_large(chosen: list[str]) -> None:
    known = set(list_paths(compose(BASELINE).values))
    values = compose([*BASELINE, *chosen]).values
    check_all(values, [path for path in list_paths(values) if path not in known])


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("optimizer.tournament_size", "1000000000"),
        ("course.time_limit_s", "1e9"),
        ("simulator.time_step", "1e-20"),
        ("seed", str(2**63)),
        ("executor.workers", "1000000000"),
    ],
)
def test_a_slip_of_the_keyboard_costs_neither_memory_nor_time(key: str, value: str) -> None:
    with pytest.raises(InputError) as refusal:
        preflight(compose(["simulator=planar", f"{key}={value}"]).build())
    assert key.rpartition(".")[2] in str(refusal.value)
