"""The examples of docs/python.md run."""

import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import code
from examples import SMALL, short_run
from fixture_types import Capture, Patch

import evoros
import evoros.api
from evoros.base.arrays import Array
from evoros.config.compose import compose
from evoros.config.configuration import Configuration


class Cma:
    """Stands for the library: asks for uniform draws."""

    def __init__(self, start: list[float], sigma: float, options: dict[str, Any]) -> None:
        self.size, self.rng, self.calls = len(start), np.random.default_rng(0), 0

    def ask(self) -> list[Array]:
        return [self.rng.random(self.size) for _ in range(2)]

    def tell(self, genomes: list[Array], values: list[float]) -> None:
        assert len(genomes) == len(values)
        assert all(value <= 0 for value in values)  # fitness is maximized, cma minimizes
        self.calls += 1


@pytest.mark.slow
def test_the_examples_in_python_run(mine: Path, monkeypatch: Patch, capsys: Capture) -> None:
    """With the configuration of the example's simulator in place of the one that is typed."""
    short_run("outputs/mine", ["failure=frontal"])  # the run that the examples read
    cma = types.ModuleType("cma")
    cma.CMAEvolutionStrategy = Cma  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "cma", cma)
    typed: list[str] = []

    def quicker(overrides: Any, config_dir: object) -> Configuration:
        typed.extend(overrides)
        # The link and the worlds of the document stay: only what costs time is replaced.
        worlds = [f"world.{name}.course.time_limit_s=0.1" for name in ("boxes", "maze", "blocks")]
        small = [] if "experiment=quickstart" not in overrides else SMALL
        fast = ["simulator=kinematic", "executor=serial", "figures=[]", *worlds, *small]
        return compose([*overrides, *fast], config_dir="mine")

    monkeypatch.setattr(evoros.api, "_compose", quicker)
    for block in code("python"):
        shorter = block.replace("range(10)", "range(1)").replace("generations=5", "generations=3")
        exec(shorter, {"__name__": "__main__"})
    assert {"seed=1", "trials=3", "trials=2"} <= set(typed)
    printed = capsys.readouterr().out
    assert all(word in printed for word in ("maze_progress", "validated_fitness", "yard"))
