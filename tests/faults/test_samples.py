"""A sample of the cases that ``python benchmarks/faults`` counts: each of them is whole."""

from importlib import import_module

import pytest
from cases import FAULT, run_cases

SEEDS = {
    "power_cuts": range(5, 9),
    "damages": range(40, 46),
    "hostile": range(113, 119),
    "fuzz": range(80),
    "kills": range(1, 2),
}
MORE = {
    "power_cuts": range(1000, 1060),
    "hostile": range(113, 132),
    "fuzz": range(1000, 1600),
    "kills": range(12),
}


def list_faults(name: str, seeds: range) -> list[str]:
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
