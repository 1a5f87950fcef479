"""An evaluation of a run's champion under the run's configuration and draws is the run again."""

import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers import resume

import evoros
from evoros.base.errors import InputError
from evoros.cli.command import evaluate
from evoros.config.compose import compose
from evoros.failure.protocol import Case
from evoros.mission.mission import Mission
from evoros.mission.rollout import run_mission
from evoros.session.given_designs import read_given
from evoros.session.status import NoDisplay
from evoros.storage.tables import OUTCOME_COLUMNS, cell, outcome_cells
from evoros.terminal.console import DONE, INPUT

SLOW = ("benchmark_priced", "eyes_detection", "reckoning", "redundancy", "robust")
"""Experiments that differ in what a run records, scores and chooses by."""
SMALL = [
    *("executor=serial", "figures=[]", "record=none", "course.time_limit_s=8"),
    *("optimizer.population_size=4", "optimizer.generations=2", "optimizer.validation_trials=2"),
    *("validation.trials=2", "validation.max_trials=3"),
]
TEAM = ["experiment=two_rovers", *SMALL, "trials=1"]
BLIND = [
    "+design@agents.oncoming.design=six_sonars",
    "agents.oncoming.design.number=0",
    "agents.oncoming.scored=false",
]
NOBODY = "the row is ignored, because the agent oncoming does not exist and the row has no sensor"
VALIDATION = "evaluation_draws=validation"
DESIGNS = {"rover": "one_lidar", "neural": "priced_sensors"}
REACH = "{_target_: evoros.design.genes.Gene, key: KEY, low: 0.8, high: 2.5}"


def evolve(folder: Path, overrides: Sequence[str]) -> Path:
    evoros.run(compose([*overrides]), folder, display=NoDisplay())
    return folder


def score(run: Path, folder: Path, overrides: Sequence[str]) -> pd.DataFrame:
    """Return the missions of an evaluation of the run's champion, as text."""
    places = [f"designs={run}", f"hydra.run.dir={folder}"]
    assert evaluate([*overrides, *places]) == DONE
    return read_missions(folder)


def read_missions(folder: Path) -> pd.DataFrame:
    table = pd.read_csv(folder / "missions.csv", dtype=str, keep_default_na=False)
    return table.astype({"trial": int}).sort_values(["world", "trial"], ignore_index=True)


def list_champion_missions(run: Path) -> pd.DataFrame:
    missions = read_missions(run)
    champion = pd.read_csv(run / "champion" / "design.csv", dtype=str)["design"].iloc[0]
    scored: pd.DataFrame = missions[missions["design"] == champion]
    return scored


def require_same_validation(run: Path, folder: Path, overrides: Sequence[str]) -> None:
    """The rows of the run's validation are those of the evaluation, to the last character."""
    scored = score(run, folder, [*overrides, VALIDATION])
    recorded = list_champion_missions(run)
    recorded = recorded[recorded["purpose"] == "validation"].reset_index(drop=True)
    if "validation.trials=2" in overrides:  # a precision adds further trials
        recorded = recorded[recorded["draws"].isin(scored["draws"])].reset_index(drop=True)
    assert len(scored)
    common = [name for name in scored if name not in ("source", "design", "digest")]
    pd.testing.assert_frame_equal(scored[common], recorded[common])


def require_same_missions(run: Path, overrides: Sequence[str]) -> None:
    """The champion as an evaluation reads it drives each of its recorded missions again."""
    experiment = compose([*overrides]).build()
    (champion,) = read_given([str(run)], experiment)
    prefixes = ("", *(f"{agent}." for agent in experiment.agents))
    columns = [f"{prefix}{name}" for prefix in prefixes for name in OUTCOME_COLUMNS]
    for _, row in list_champion_missions(run).iterrows():
        mission = Mission(
            int(row["generation"]),
            int(row["design"]),
            champion.design,
            row["world"],
            row["trial"],
            row["purpose"],
            row["draws"],
            Case.parse(row["case"]) if row.get("case") else None,
        )
        outcomes, _ = run_mission(experiment.scenario_for(mission.purpose), mission)
        assert [cell(value) for value in outcome_cells(outcomes)] == row[columns].tolist()


@pytest.mark.parametrize(
    "name", ["quickstart", *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)]
)
def test_a_bundled_experiment_is_evaluated_as_it_ran(name: str, tmp_path: Path) -> None:
    overrides = [f"experiment={name}", *SMALL, "simulator=planar", "hydra.mode=RUN"]
    if compose(overrides).values["validation"]["precision"] is not None:
        overrides.append("validation.precision=5")  # which three trials can reach
    run = evolve(tmp_path / "run", overrides)
    require_same_validation(run, tmp_path / "scores", overrides)
    require_same_missions(run, overrides)


def draw_parts(seed: int) -> list[str]:
    """Draw a combination of parts; each seed gives another."""
    rng = random.Random(seed)
    agent, controller = "agents.oncoming", rng.choice(["rover", "rover", "neural"])
    parts = [
        f"controller={controller}",
        f"failure={rng.choice(['none', 'random', 'spatial', 'combined', 'adversarial'])}",
        f"draws={rng.choice(['generation', 'individual', 'run'])}",
        f"design={rng.choice(['six_sonars', 'free_sonars', DESIGNS[controller]])}",
        f"trials={rng.choice([1, 2])}",
        f"seed={rng.randrange(1000)}",
    ]
    kind = rng.choice(["none", "shared", "blind", "fixed", "evolving", "evolving"])
    if controller == "rover" and rng.random() < 0.7:
        parts.append(f"+design.genes.reach={reach('controller.avoidance.range_m')}")
    if kind == "none":
        return [*parts, "agents=none"]
    if kind == "shared":
        return [*parts, f"{agent}.scored={rng.choice(['true', 'false'])}"]
    parts += [BLIND[0], f"+controller@{agent}.controller={rng.choice(['rover', 'rover_l1'])}"]
    if kind == "evolving":
        parts += [f"{agent}.design.number={rng.choice(['1', '[0,1]'])}", f"{agent}.scored=true"]
        return [*parts, f"+{agent}.design.genes.far={reach('controller.avoidance.range_m')}"]
    if kind == "fixed":
        fixed = "{_target_: evoros.design.space.FixedSensor, sensor: sonar, link: base_link"
        parts.append(f"+{agent}.design.fixed.nose={fixed}, x_m: 0.3, z_m: 0.2, pitch_deg: 12.5}}")
    return [*parts, f"{agent}.design.number=0", f"{agent}.scored={rng.choice(['true', 'false'])}"]


def reach(key: str) -> str:
    return REACH.replace("KEY", key)


@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (3, 7, 35, 38))]
)
def test_drawn_parts_are_evaluated_as_they_ran(seed: int, tmp_path: Path) -> None:
    overrides = ["experiment=two_rovers", *SMALL, *draw_parts(seed)]
    run = evolve(tmp_path / "run", overrides)
    require_same_validation(run, tmp_path / "scores", overrides)
    require_same_missions(run, overrides)


# Robots that an evaluation has and its designs have not, and the other way round --------------


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run without other robots, whose controller has a gene."""
    gene = f"+design.genes.reach={reach('controller.avoidance.range_m')}"
    return evolve(tmp_path_factory.mktemp("alone") / "run", [*TEAM, "agents=none", gene])


@pytest.fixture(scope="module")
def blind(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run beside a robot without sensors."""
    return evolve(tmp_path_factory.mktemp("blind") / "run", [*TEAM, *BLIND])


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two robots whose designs evolve."""
    blind = [BLIND[0], "agents.oncoming.design.number=1"]
    return evolve(tmp_path_factory.mktemp("both") / "run", [*TEAM, *blind])


@pytest.mark.slow
def test_a_robot_that_was_not_in_the_run_is_driven_as_configured(
    alone: Path, tmp_path: Path
) -> None:
    """It has no sensors, and not the genes of the first robot's controller."""
    added = [*BLIND, "+controller@agents.oncoming.controller=rover_l1"]
    fixed = "{_target_: evoros.design.space.FixedSensor, sensor: sonar, link: base_link, x_m: 0.3}"
    nose = [f"+agents.oncoming.design.fixed.nose={fixed}"]
    for count, more in enumerate((added, [*added, *nose])):
        rows = score(alone, tmp_path / f"{count}", [*TEAM, *more])
        assert rows["oncoming.sensors"].tolist() == [f"{count}"]
        assert rows["sensors"].tolist() == ["6"]


@pytest.mark.slow
def test_a_robot_without_sensors_has_none_in_an_evaluation(blind: Path, tmp_path: Path) -> None:
    rows = score(blind, tmp_path / "scores", [*TEAM, *BLIND])
    assert rows["oncoming.sensors"].tolist() == ["0"]
    assert resume(tmp_path / "scores") == DONE


def test_a_robot_without_sensors_can_be_left_out(
    blind: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = score(blind, tmp_path / "scores", [*TEAM, "agents=none"])
    assert not any(str(name).startswith("oncoming.") for name in rows)
    (line,) = (line for line in capsys.readouterr().err.splitlines() if "row is ignored" in line)
    assert line.endswith(f"{blind}/champion/design.csv: line 8: {NOBODY}")


def test_designs_of_python_are_completed_likewise() -> None:
    """One that is made by hand for a robot has no sensors for the other."""
    config = compose([*TEAM, *BLIND])
    design = (
        config.build().members[0].space.decode(np.full(config.build().members[0].space.size, 0.5))
    )
    with evoros.Evaluator(config, display=NoDisplay()) as evaluator:
        (sensors,) = evaluator.missions([design])["oncoming.sensors"]
        assert sensors == 0
        with pytest.raises(
            InputError, match=r"agents: the design has a part for 'stranger', .*oncoming"
        ):
            evaluator.score([replace(design, agents={"stranger": design})])


@pytest.mark.parametrize(
    ("run", "more", "message"),
    [
        ("alone", [BLIND[0]], "agents.oncoming.design: must leave nothing to evolve"),
        ("both", [], "agents.oncoming.design: must not be null"),
        (
            "both",
            BLIND,
            "agents.oncoming.design: must be the design that the run used for this agent",
        ),
        ("both", ["agents=none"], "agent must be one of the experiment's agents (none)"),
        (
            "alone",
            ["agents=none", VALIDATION, "worst_cases=search"],
            "worst_cases: cannot be combined with evaluation_draws=validation",
        ),
        (
            "alone",
            [
                *("agents=none", VALIDATION),
                *("optimizer.validation_trials=0", "validation.trials=null"),
            ],
            "validation.trials: with evaluation_draws=validation, must be at least 1",
        ),
    ],
)
def test_what_does_not_fit_the_run_is_refused_in_one_line(
    run: str,
    more: list[str],
    message: str,
    tmp_path: Path,
    request: pytest.FixtureRequest,
    capsys: pytest.CaptureFixture[str],
) -> None:
    places = [f"designs={request.getfixturevalue(run)}", f"hydra.run.dir={tmp_path / 'scores'}"]
    capsys.readouterr()
    assert evaluate([*TEAM, *more, *places]) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not (tmp_path / "scores").exists()


def test_a_run_has_draws_of_its_own() -> None:
    with pytest.raises(InputError, match="evaluation_draws: cannot be used in a run"):
        evoros.run(compose([*TEAM, f"+{VALIDATION}"]), "never", display=NoDisplay())
