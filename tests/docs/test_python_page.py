"""docs/python.md names the whole interface, and its examples run."""

import dataclasses
import inspect
import re
import sys
import types
from typing import Any

import numpy as np
import pytest
from documents import code, table, text
from examples import SMALL

import evoros
import evoros.api
from evoros.base.arrays import Array
from evoros.config.compose import compose
from evoros.config.configuration import Configuration


def test_every_public_name_is_documented_and_no_other() -> None:
    rows = [row[0] for row in table(text("python"), "name")]
    assert {re.sub(r"\(.*", "", row).removeprefix("evoros.") for row in rows} == set(evoros.__all__)
    for row in rows:
        function = getattr(evoros, re.sub(r"\(.*", "", row).removeprefix("evoros."))
        for argument in re.findall(r"\w+", row.partition("(")[2]):
            assert argument in inspect.signature(function).parameters, row


def test_every_attribute_of_a_run_is_documented() -> None:
    public = {name for name in dir(evoros.Run) if not name.startswith("_")} | {"path"}
    assert {row[0].split("(")[0] for row in table(text("python"), "attribute")} == public


def test_every_field_of_a_configuration_is_documented() -> None:
    public = {field.name for field in dataclasses.fields(Configuration)} - {"designs"}
    assert {row[0] for row in table(text("python"), "field")} == public


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


def test_the_examples_in_python_run(
    finished: evoros.Run, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the configuration of the example's simulator in place of the one that is typed."""
    cma = types.ModuleType("cma")
    cma.CMAEvolutionStrategy = Cma  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "cma", cma)
    typed: list[str] = []

    def quicker(overrides: Any) -> Configuration:
        typed.extend(overrides)
        # The link and the worlds of the document stay: only what costs time is replaced.
        worlds = [f"world.{name}.course.time_limit_s=0.1" for name in ("boxes", "maze", "blocks")]
        small = [] if "experiment=quickstart" not in overrides else SMALL
        fast = ["simulator=kinematic", "executor=serial", "figures=[]", *worlds, *small]
        return compose([*overrides, *fast], "mine")

    monkeypatch.setattr(evoros.api, "_compose", quicker)
    for block in code("python"):
        shorter = block.replace("range(10)", "range(1)").replace("generations=5", "generations=3")
        exec(shorter, {"__name__": "__main__"})
    assert {"seed=1", "trials=3", "trials=2"} <= set(typed)
    printed = capsys.readouterr().out
    assert all(word in printed for word in ("maze_progress", "validated_fitness", "yard"))
