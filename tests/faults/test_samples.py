"""A sample of the cases that ``python benchmarks/faults`` counts: each of them is whole."""

from collections.abc import Sequence
from importlib import import_module

import pytest
from cases import FAULT, run_cases

SEEDS: dict[str, Sequence[int]] = {"hostile": (113, 115, 116, 124, 127, 131), "fuzz": range(40)}
MORE: dict[str, Sequence[int]] = {
    "power_cuts": (1, 5, 6, 8, *range(1002, 1008), 1010, 1011),  # of all commands
    "damages": (41, 43, 45),  # of a sweep, a killed run and an evaluation
    "hostile": (114, 117, 119, 121, 125, 129),
    "fuzz": range(1000, 1020),
    "kills": (2,),  # three times with two workers
}


def list_faults(name: str, seeds: Sequence[int]) -> list[str]:
    module = import_module(name)
    results = list(run_cases(module.prepare, seeds, module.LIMIT_S))
    assert len(results) == len(seeds)
    return [f"{name} {seed}: {result}" for seed, result in results if result.verdict == FAULT]


@pytest.mark.parametrize("name", SEEDS)
def test_some_faults_of_each_kind_lose_nothing(name: str) -> None:
    assert list_faults(name, SEEDS[name]) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", MORE)
def test_more_faults_of_each_kind_lose_nothing(name: str) -> None:
    assert list_faults(name, MORE[name]) == []
