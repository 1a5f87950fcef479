"""``60``, ``60.0`` and ``6e1`` are one number, whichever of them is typed."""

import copy
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest
from helpers import everything, resume, tiny
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.config.compose import compose
from evoros.config.configuration import Configuration
from evoros.terminal.console import DONE

EXPERIMENTS = (
    ["simulator=planar", "failure=spatial"],
    ["simulator=mujoco", "controller=rover_l1", "failure=combined"],
    ["experiment=reckoning"],
    ["experiment=two_rovers"],
    ["world=generated", "design=around"],
)
KEYS = {
    "course.time_limit_s": (1, 600),
    "controller.avoidance.range_m": (1, 4),
    "design.sensors.sonar.range_max_m": (2, 9),
    "failure.latest_s": (40, 90),
    "optimizer.mutation_probability": (0, 1),
}
"""Keys of floats, with their ranges of whole numbers."""


def list_numbers(part: object, path: str = "") -> Iterator[tuple[str, type, object]]:
    """Yield each number in the parts of an experiment, with its place and its type."""
    if is_dataclass(part):
        children: Any = {field.name: getattr(part, field.name) for field in fields(part)}
    elif isinstance(part, Mapping):
        children = part
    elif isinstance(part, list | tuple):
        children = dict(enumerate(part))
    else:
        if isinstance(part, int | float):
            yield path, type(part), part
        return
    for key, child in children.items():
        yield from list_numbers(child, f"{path}.{key}")


def with_whole_numbers(values: Any) -> Any:
    """The values of a configuration, whose floats without a fraction are whole numbers."""
    if isinstance(values, Mapping):
        return {key: with_whole_numbers(value) for key, value in values.items()}
    if isinstance(values, list | tuple):
        return [with_whole_numbers(value) for value in values]
    return int(values) if isinstance(values, float) and values.is_integer() else values


@pytest.mark.parametrize("overrides", EXPERIMENTS, ids=" ".join)
def test_whole_numbers_build_what_floats_build(overrides: list[str]) -> None:
    values = copy.deepcopy(dict(compose(overrides).values))
    whole = with_whole_numbers(values)
    assert whole is not values
    built = [list(list_numbers(Configuration("", v).build())) for v in (values, whole)]
    assert built[0] == built[1]
    assert len(built[0]) > 50


@settings(max_examples=12)
@given(st.data())
def test_every_way_to_type_a_number_builds_the_same(data: st.DataObject) -> None:
    key = data.draw(st.sampled_from(sorted(KEYS)))
    number = data.draw(st.integers(*KEYS[key]))
    texts = (f"{number}", f"{number}.0", f"{number}e0")
    built = [
        list(list_numbers(compose(["failure=random", f"{key}={text}"]).build())) for text in texts
    ]
    assert built[0] == built[1] == built[2]


def test_a_lost_trajectory_of_a_whole_time_limit_is_flown_again(tmp_path: Path) -> None:
    """A mission that ends at the limit has it in its row, which must be the same again."""
    run = tmp_path / "run"
    limits = [f"world.{name}.course.time_limit_s=3" for name in ("near", "far")]
    assert tiny(run, *limits, "record=all", "optimizer.generations=1") == DONE
    before = {name: file for name, file in everything(run).items() if name.startswith("traj")}
    rows = (run / "missions.csv").read_bytes()
    assert b",3.0,3.0," in rows
    lost = next(iter(before))
    (run / lost).unlink()
    assert resume(run) == DONE
    assert (run / "missions.csv").read_bytes() == rows
    assert (run / lost).read_bytes() == before[lost]
