"""An evaluation of a run's champion under the run's configuration and draws is the run again."""

import random
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import pytest
from helpers import ROOT

import evoros
from evoros.base.console import DONE, INPUT
from evoros.cli.evaluate import evaluate
from evoros.config.compose import compose
from evoros.mission.mission import Mission
from evoros.mission.rollout import run_mission
from evoros.session.given_designs import read_given
from evoros.session.replay import read_case
from evoros.session.status import NoDisplay
from evoros.storage.tables import OUTCOME_COLUMNS, cell, outcome_cells

EXPERIMENTS = sorted(path.stem for path in (ROOT / "conf" / "experiment").glob("*.yaml"))
SMALL = [
    *("executor=serial", "figures=[]", "record=none", "course.time_limit_s=8"),
    *("optimizer.population_size=3", "optimizer.generations=2", "optimizer.validation_trials=2"),
    *("validation.first=2", "validation.max_trials=3"),
]
TEAM = ["experiment=two_rovers", *SMALL, "trials=1"]
BLIND = [
    "+design@agents.oncoming.design=six_sonars",
    "agents.oncoming.design.number=0",
    "agents.oncoming.scored=false",
]
VALIDATION = "evaluation_draws=validation"
REACH = "{_target_: evoros.design.genes.Gene, key: KEY, low: 0.8, high: 2.5}"


def evolve(folder: Path, overrides: Sequence[str]) -> Path:
    evoros.run(compose([*overrides]), folder, NoDisplay())
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
    return missions[missions["design"] == champion]


def require_same_validation(run: Path, folder: Path, overrides: Sequence[str]) -> None:
    """The rows of the run's validation are those of the evaluation, to the last character."""
    scored = score(run, folder, [*overrides, VALIDATION])
    recorded = list_champion_missions(run)
    recorded = recorded[recorded["purpose"] == "validation"].reset_index(drop=True)
    if "validation.first=2" in overrides:  # the second stage of a precision has more trials
        recorded = recorded[recorded["draws"].isin(scored["draws"])].reset_index(drop=True)
    assert len(scored) >= 2
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
            read_case(row),
        )
        outcome, _ = run_mission(experiment.scenario_for(mission.purpose), mission)
        assert [cell(value) for value in outcome_cells(outcome)] == row[columns].tolist()


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_a_bundled_experiment_is_evaluated_as_it_ran(name: str, tmp_path: Path) -> None:
    overrides = [f"experiment={name}", *SMALL, "simulator=planar"]
    run = evolve(tmp_path / "run", overrides)
    require_same_validation(run, tmp_path / "scores", overrides)
    require_same_missions(run, overrides)


def draw_parts(number: int) -> list[str]:
    """Draw a combination of parts; each number gives another."""
    rng = random.Random(number)
    agent, controller = "agents.oncoming", rng.choice(["rover", "rover", "neural"])
    parts = [
        f"controller={controller}",
        f"failure={rng.choice(['none', 'random', 'spatial', 'combined', 'adversarial'])}",
        f"draws={rng.choice(['generation', 'individual', 'run'])}",
        f"design={rng.choice(['six_sonars', 'free_sonars', 'priced_sensors'])}",
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
        fixed = "{_target_: evoros.design.fixed.FixedSensor, sensor: sonar, link: base_link"
        parts.append(f"+{agent}.design.fixed.nose={fixed}, x_m: 0.3, z_m: 0.2, pitch_deg: 12.5}}")
    return [*parts, f"{agent}.design.number=0", f"{agent}.scored={rng.choice(['true', 'false'])}"]


def reach(key: str) -> str:
    return REACH.replace("KEY", key)


def require_same(number: int, folder: Path) -> None:
    overrides = ["experiment=two_rovers", *SMALL, *draw_parts(number)]
    run = evolve(folder / "run", overrides)
    require_same_validation(run, folder / "scores", overrides)
    require_same_missions(run, overrides)


@pytest.mark.parametrize("number", range(8))
def test_drawn_parts_are_evaluated_as_they_ran(number: int, tmp_path: Path) -> None:
    require_same(number, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(8, 60))
def test_many_drawn_parts_are_evaluated_as_they_ran(number: int, tmp_path: Path) -> None:
    require_same(number, tmp_path)
