"""Bad input, values in other units, and controllers that do not repeat are found before a run."""

import logging
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fixture_types import Capture, Patch
from helpers import (
    TINY,
    USER_PARTS,
    everything,
    finished_run,
    refusal,
    resume,
    scored,
    tiny,
    with_parts,
)
from hypothesis import given
from hypothesis import strategies as st
from numpy.random import Generator

from evoros import Evaluator
from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.cli.command import evaluate
from evoros.config.compose import compose
from evoros.controller.line_controller import Program
from evoros.controller.rover import Rover
from evoros.evolution.experiment import Experiment
from evoros.executor.processes import Processes
from evoros.executor.serial import Serial
from evoros.failure.protocol import Failure, Fault
from evoros.failure.random import RandomFailure
from evoros.filter.protocol import Channels
from evoros.filter.silence import Silence
from evoros.mission import compiled_loop
from evoros.mission.inputs import ENGINE_RULES, LoopInputs
from evoros.mission.mission import TRAJECTORY
from evoros.optimizer.ga import GeneticAlgorithm
from evoros.preflight.own_code import find_difference, report_repeatability
from evoros.preflight.preflight import check_units, check_workers, preflight
from evoros.robot.model import Robot
from evoros.simulator.planar import Planar
from evoros.terminal.console import DONE, INPUT

FAR = (
    "+design.genes.far={_target_: evoros.design.genes.Gene, "
    "key: design.sensors.sonar.range_max_m, low: %s, high: 4.5}"
)
NEAR = (
    "+design.genes.near={_target_: evoros.design.genes.Gene, "
    "key: design.sensors.sonar.range_min_m, low: 0.06, high: 2}"
)


@pytest.fixture
def calls(monkeypatch: Patch) -> Counter[str]:
    """Count what would be opened, drawn, started, equipped or compiled."""
    counter: Counter[str] = Counter()

    def count(owner: Any, name: str) -> None:
        original = getattr(owner, name)

        def counted(*args: Any, **kwargs: Any) -> Any:
            counter[name] += 1
            return original(*args, **kwargs)

        monkeypatch.setattr(owner, name, counted)

    count(Rover, "open")
    count(RandomFailure, "draw")
    count(GeneticAlgorithm, "start")
    count(Robot, "with_sensors")
    count(compiled_loop, "try_compile")
    return counter


@pytest.mark.slow
def test_building_an_experiment_starts_none_of_its_parts(calls: Counter[str]) -> None:
    experiment = compose(["simulator=planar", "failure=random", "executor=serial"]).build()
    assert not calls
    preflight(experiment)
    once = {"open", "draw", "start"}
    assert {name: calls[name] for name in once} == dict.fromkeys(once, 1)
    assert calls["try_compile"]


REFUSED = ["design.sensors.sonar.range_max_m=1.5"]
SAID = "controller: WeightedVoting.range_m: "


@pytest.mark.slow
def test_every_way_in_refuses_what_a_part_refuses_only_when_it_starts(
    tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "designs.csv").write_text("design,sensor,x_m,y_m,yaw_deg\n1,0,0.1,0,0\n")
    assert tiny(tmp_path / "run", *REFUSED) == INPUT
    assert SAID in capsys.readouterr().err
    chosen = [f"designs={tmp_path / 'designs.csv'}", f"hydra.run.dir={tmp_path / 'scores'}"]
    assert evaluate([*TINY, "executor=serial", *chosen, *REFUSED]) == INPUT
    assert SAID in capsys.readouterr().err
    config = compose(["experiment=tiny", "executor=serial", *REFUSED], config_dir=USER_PARTS)
    with pytest.raises(InputError, match=f"^{SAID}"):
        Evaluator(config)
    assert set(everything(tmp_path)) == {"designs.csv"}


@pytest.mark.slow
def test_what_is_resumed_is_tried_too(tmp_path: Path, capsys: Capture, monkeypatch: Patch) -> None:
    (tmp_path / "designs.csv").write_text("design,sensor,x_m,y_m,yaw_deg\n1,0,0.1,0,0\n")
    finished_run(tmp_path / "run", "optimizer.generations=1")
    scored(tmp_path / "scores", tmp_path / "designs.csv")
    before = everything(tmp_path)

    def refuse(*_: object) -> None:
        raise InputError("must not be opened; leave it shut")

    monkeypatch.setattr(Rover, "open", refuse)
    capsys.readouterr()
    assert resume(tmp_path / "run") == INPUT
    assert resume(tmp_path / "scores") == INPUT
    assert capsys.readouterr().err.count("controller: must not be opened; leave it shut\n") == 2
    assert everything(tmp_path) == before


@pytest.mark.slow
def test_genes_that_do_not_fit_together_are_refused_before_the_run(
    tmp_path: Path, capsys: Capture
) -> None:
    refused = refusal(tmp_path, capsys, NEAR, FAR % 1)
    assert "design.genes, near at high, far at low: " in refused
    assert tiny(tmp_path / "run", NEAR, FAR % 2.5, "optimizer.generations=1") == DONE


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["design.number=0"], "evolve"),
        (["+filter@design.sensors.sonar.filters.x=pose_noise"], "PoseNoise: "),
        (["filter@failure.effect=pose_noise"], "PoseNoise: "),
        (["design.sensors.sonar.range_max_m=1.5"], "controller: WeightedVoting.range_m: "),
    ],
)
def test_what_would_break_inside_a_run_is_refused_before_it(
    arguments: list[str], said: str, tmp_path: Path, capsys: Capture
) -> None:
    assert said in refusal(tmp_path, capsys, *arguments)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("run", "confirming", "compiled"),
    [("pybullet", "mujoco", "e"), ("pybullet", "planar", "ep"), ("planar", "planar", "p")],
)
def test_the_rules_of_both_simulators_are_compiled_once_before_the_run(
    run: str, confirming: str, compiled: str, monkeypatch: Patch
) -> None:
    met: list[LoopInputs] = []
    monkeypatch.setattr("evoros.preflight.preflight.prepare", met.append)
    monkeypatch.setattr("evoros.preflight.preflight.explain_interpreted", lambda parts: [])
    chosen = [f"simulator={run}", f"simulator@confirmation.simulator={confirming}"]
    experiment = compose(["confirmation=physics", *chosen]).build()
    preflight(experiment)
    robot = experiment.robot
    (rules,) = {
        Planar().choose_rules(world.at("test"), [robot]) for world in experiment.world.values()
    }
    filters = [len(parts.filters) for parts in met]
    whole = [
        tuple(parts[:3]) for parts, count in zip(met, filters, strict=True) if count == max(filters)
    ]
    expected = {"e": ENGINE_RULES, "p": rules}
    assert sorted(whole, key=repr) == sorted((tuple(expected[kind]) for kind in compiled), key=repr)


class Unnamed(Rover):
    modes = ("navigating",)  # type: ignore[assignment]


def test_a_controller_must_name_the_modes_of_all_its_layers() -> None:
    experiment = compose(["simulator=planar", "executor=serial"]).build()
    rover = experiment.controller
    assert isinstance(rover, Rover)
    preflight(experiment)
    with pytest.raises(InputError, match=r"^controller\.modes: must name one mode for each of"):
        preflight(replace(experiment, controller=Unnamed(rover.avoidance, rover.navigation)))


@dataclass(frozen=True)
class Wrong(Failure):
    """A failure model whose faults have not one number for each sensor."""

    choose: Callable[[int], Any]

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        return (Fault(Silence(), self.choose(channels.size)),)


@pytest.fixture(scope="module")
def faultless() -> Experiment:
    return compose(["simulator=planar", "executor=serial"]).build()


def test_a_fault_with_an_onset_for_each_sensor_is_right(faultless: Experiment) -> None:
    preflight(replace(faultless, failure=Wrong(lambda n: np.full(n, 5.0))))


@pytest.mark.parametrize(
    "choose",
    [
        lambda n: np.full(n - 1, 5.0),
        lambda n: np.full(n + 1, 5.0),
        lambda n: np.full((n, 1), 5.0),
        lambda n: np.full(n, np.nan),
        lambda n: np.full(n, "late"),
        lambda n: 5.0,
    ],
)
def test_a_fault_must_have_an_onset_for_each_sensor(
    choose: Callable[[int], Any], faultless: Experiment
) -> None:
    """Compiled code would read past the end of an array that is too short."""
    with pytest.raises(InputError, match=r"^failure: Wrong must draw one onset time \[s\] for"):
        preflight(replace(faultless, failure=Wrong(choose)))


PLANE = ("simulator=planar", "executor=serial", "world=maze")


@pytest.mark.parametrize(
    ("usual", "mistaken", "meant"),
    [
        ("course.home_yaw_rad=-6.2", "course.home_yaw_rad=-90", "set it to -1.571 in radians"),
        (
            "design.sensors.sonar.range_max_m=999",
            "design.sensors.sonar.range_max_m=6000",
            "set it to 6 in metres",
        ),
    ],
)
def test_a_value_in_another_unit_is_told_with_the_value_in_the_right_one(
    usual: str, mistaken: str, meant: str
) -> None:
    assert list(check_units(compose([*PLANE, usual]).build())) == []
    (warning,) = check_units(compose([*PLANE, mistaken]).build())
    assert mistaken.rpartition("=")[0].rpartition(".")[2] in warning
    assert warning.endswith(meant)


def test_only_many_more_workers_than_cores_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evoros.preflight.preflight.available_cores", lambda: 2)
    experiment = compose(PLANE).build()
    for workers in (0, 1, 8):
        assert list(check_workers(replace(experiment, executor=Processes(workers=workers)))) == []
    (warning,) = check_workers(replace(experiment, executor=Processes(workers=9)))
    assert warning.startswith("executor.workers: 9 workers share 2 cores")


PROGRAM = """
import json, os, sys
source, answers = open(int(os.environ["EVOROS_IN"])), open(int(os.environ["EVOROS_OUT"]), "w")
source.readline()
print('{"ready": true}', file=answers, flush=True)
once = os.path.exists(sys.argv[1])
open(sys.argv[1], "w").close()
for line in source:
    time = json.loads(line)[0]
    print(json.dumps([1, 0.2, 0.1 if once and time >= 2.0 else 0.0]), file=answers, flush=True)
"""


@pytest.mark.parametrize("repeatable", [True, False])
def test_the_first_tick_that_differs_is_named(
    repeatable: bool, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    mark = tmp_path / "mark"
    if repeatable:
        mark.touch()
    command = ["/usr/bin/env", "python3", str(tmp_path / "program.py"), str(mark)]
    experiment = compose(
        ["simulator=planar", "world=boxes", "world.boxes.course.time_limit_s=4"]
    ).build()
    scenario = with_parts(experiment.scenario, controller=Program(command=command))
    design = experiment.space.decode(np.full(experiment.space.size, 0.5))
    mission = experiment.plan.selection(0, 0, design)[0]
    with caplog.at_level(logging.WARNING), Serial().open() as pool:
        report_repeatability(scenario, mission, pool)
    (*lines,) = (record.getMessage() for record in caplog.records)
    if repeatable:
        assert lines == []
    else:
        # The command of 2 s has turned the front wheels, and it is recorded in that decision's row.
        (line,) = lines
        assert "runs differ from tick 20 on, at 2 s (steering_rad" in line


COLUMNS = [*TRAJECTORY, "range_0_m", "range_1_m"]


@given(st.integers(1, 20), st.integers(0, 19), st.integers(0, len(TRAJECTORY) - 1))
def test_the_row_and_the_column_of_a_change_are_found(rows: int, row: int, column: int) -> None:
    row = row % rows
    first: Array = np.random.default_rng(rows).normal(size=(rows, len(TRAJECTORY) + 2))
    first[:, -1] = np.nan  # a silent sensor does not differ from itself
    second = first.copy()
    assert find_difference(first, second, COLUMNS) == ""
    second[row:, column] += 1.0
    difference = find_difference(first, second, COLUMNS)
    assert f"from tick {row} on" in difference
    assert f"({TRAJECTORY[column]} " in difference


def test_a_trajectory_that_ends_earlier_differs() -> None:
    first = np.zeros((5, len(TRAJECTORY)))
    assert "from tick 3 on, because they end at" in find_difference(first, first[:3], TRAJECTORY)
