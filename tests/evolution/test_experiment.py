from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import USER_PARTS, content, finished_run, resume, tiny
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.cli.main import evoros
from evoros.config.compose import compose
from evoros.design.genes import MAX_EXHAUSTIVE, Gene, enumerate_corners
from evoros.evolution.experiment import Experiment, check_case
from evoros.fitness.equation_one import EquationOne
from evoros.fitness.protocol import Fitness
from evoros.fitness.worst_case import WorstCase
from evoros.mission.mission import TRAJECTORY, Outcome
from evoros.mission.rollout import run_mission
from evoros.optimizer.protocol import Score
from evoros.storage.reading import load_run
from evoros.terminal.console import DONE
from evoros.testing.subjects import example_outcome


@pytest.mark.slow
def test_the_same_bytes_for_any_number_of_workers(tmp_path: Path) -> None:
    more = ["draws=individual", "trials=2"]
    assert tiny(tmp_path / "serial", *more) == DONE
    processes = ["executor=processes", "executor.workers=2"]
    assert tiny(tmp_path / "workers", *more, *processes) == DONE
    assert content(tmp_path / "workers") == content(tmp_path / "serial")


@pytest.mark.slow
def test_the_same_bytes_in_pybullet_too(tmp_path: Path) -> None:
    """Though missions share engines in another order, and the rover pushes a box away."""
    short = ["optimizer.generations=2", "optimizer.population_size=3", "world=[boxes,blocks]"]
    short += ["optimizer.validation_trials=1", "seed=3", "course.time_limit_s=5"]
    short += ["course.home_x_m=1.066", "course.home_y_m=-1.6", "course.home_yaw_rad=-1.57"]
    short += ["course.waypoints=[[1.066,-4.5]]", "course.end_on_collision=false"]
    short += ["controller/avoidance=blind", "figures=[]", "simulator=pybullet"]
    serial, workers = tmp_path / "serial", tmp_path / "workers"
    assert evoros([*short, "executor=serial", f"hydra.run.dir={serial}"]) == DONE
    assert evoros([*short, "executor.workers=2", f"hydra.run.dir={workers}"]) == DONE
    assert content(workers) == content(serial)
    collisions = load_run(serial).missions.groupby("world").collisions.min()
    assert collisions["boxes"] > 0


def test_another_seed_draws_other_designs() -> None:
    first, second = (
        {tuple(one.genome) for one in build_tiny(f"seed={seed}").start_search().ask()}
        for seed in range(2)
    )
    assert not first & second


@pytest.mark.slow
def test_the_tables_tell_the_run_again(tmp_path: Path) -> None:
    """Fitness follows from the missions, designs from the search, the champion from both."""
    run = tmp_path / "run"
    assert tiny(run, "trials=2") == DONE
    experiment = build_tiny("trials=2")
    from evoros.storage.run_folder import RunFolder

    with RunFolder(run) as folder:
        outcomes = {key: outcome for key, _, outcome in folder.table.read(folder.read_mission)}
    table = load_run(run).generations
    search = experiment.start_search()
    for generation in range(experiment.optimizer.generations):
        asked = search.ask()
        scores = {}
        for one in asked:
            design = experiment.space.decode(one.genome)
            missions = experiment.plan.selection(generation, one.id, design)
            scores[one.id] = Score(experiment.scoring.compute_fitness(missions, outcomes))
        candidates = search.tell(scores)
        rows = table[table["generation"] == generation]
        assert list(rows["id"]) == [candidate.individual.id for candidate in candidates]
        assert list(rows["fitness"]) == [candidate.fitness for candidate in candidates]
    best = max(candidates, key=lambda candidate: candidate.fitness)
    mounts = experiment.space.decode(best.individual.genome).mounts
    champion = load_run(run).champion
    assert set(champion["design"]) == {best.individual.id}
    columns = ["x_m", "y_m", "z_m", "yaw_deg", "pitch_deg"]
    expected = [[getattr(mount, name) for name in columns] for mount in mounts]
    np.testing.assert_array_equal(champion[columns].to_numpy(), expected)


def test_the_champions_trajectory_is_that_of_its_mission(tmp_path: Path) -> None:
    run = load_run(finished_run(tmp_path / "run"))
    of_champion = run.missions["design"] == run.champion["design"][0]
    missions = run.missions[of_champion & (run.missions["purpose"] == "selection")]
    assert set(missions["world"]) == {"near", "far"}
    for row in missions.itertuples():
        track = run.trajectory(str(row.world))
        assert track["time_s"].iloc[-1] == row.time_s
        assert track["visited"].iloc[-1] == row.visited
        steps = np.diff(track[["x_m", "y_m"]].to_numpy(), axis=0)
        assert sum(np.sqrt((steps * steps).sum(axis=1)).tolist()) == row.distance_m


def test_validation_never_enters_selection(tmp_path: Path) -> None:
    without, with_it = (
        load_run(finished_run(tmp_path / f"{trials}", f"optimizer.validation_trials={trials}"))
        for trials in (0, 2)
    )
    same = [name for name in without.generations if name != "validated_fitness"]
    assert without.generations[same].equals(with_it.generations[same])
    assert without.generations["validated_fitness"].isna().all()
    best = with_it.generations.loc[with_it.generations.groupby("generation")["fitness"].idxmax()]
    assert best["validated_fitness"].notna().all()
    draws = with_it.missions.groupby("purpose")["draws"].agg(set)
    assert not draws["selection"] & draws["validation"]


def outcomes(*overrides: str) -> list[Outcome]:
    """Missions of two seconds of the middle design, one in each world."""
    experiment = compose([*overrides, "executor=serial"]).build()
    short = {
        name: replace(world, course=replace(world.course, time_limit_s=2.0))
        for name, world in experiment.world.items()
    }
    middle = experiment.space.decode(np.full(experiment.space.size, 0.5))
    scenario = replace(experiment.scenario, world=short)
    flown = [run_mission(scenario, mission) for mission in experiment.plan.selection(0, 0, middle)]
    for (outcome,), track in flown:
        assert (outcome.ended, outcome.time_s) == ("time_limit", 2.0)
        assert track.shape[1] == len(TRAJECTORY) + len(middle.mounts)
    return [outcome for (outcome,), _ in flown]


@pytest.mark.parametrize("name", ["quickstart", "case_study", "free_placement", "as_run"])
def test_every_bundled_experiment_flies(name: str) -> None:
    flown = outcomes(f"experiment={name}")
    assert len(flown) == 3
    assert all(outcome.distance_m > 0.3 for outcome in flown)


@pytest.mark.parametrize("failure", ["none", "random", "spatial", "combined"])
def test_groups_of_parts_combine(failure: str) -> None:
    early = {
        "random": ["failure.earliest_s=0.5", "failure.latest_s=0.5"],
        "spatial": ["failure.earliest_s=0.5", "failure.latest_s=0.5"],
        "combined": [
            f"failure.failures.{name}.{end}_s=0.5"
            for name in ("single", "damage")
            for end in ("earliest", "latest")
        ],
    }
    distances = set()
    for controller in ("rover", "rover_l1"):
        chosen = [f"failure={failure}", f"controller={controller}", "world=boxes"]
        (flown,) = outcomes(*chosen, *early.get(failure, []))
        assert bool(flown.failed_sensors) == (failure != "none")
        assert set(flown.failed_at_s) <= {0.5}
        distances.add(flown.distance_m)
    assert len(distances) == 2


@pytest.mark.parametrize("count", [0, 1, 3, MAX_EXHAUSTIVE, MAX_EXHAUSTIVE + 1])
def test_the_corners_have_each_gene_at_both_ends_beside_all_others(count: int) -> None:
    corners = set(enumerate_corners(count))
    assert len(corners) == (2**count if count <= MAX_EXHAUSTIVE else 2 * (count + 1))
    for gene in range(count):
        for end in (0.0, 1.0):
            alone = tuple(end if i == gene else 1.0 - end for i in range(count))
            assert {alone, (end,) * count} <= corners


@pytest.mark.slow
def test_evolved_values_that_a_part_refuses_are_the_worst_and_not_the_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The part refuses the middle of the range, which no look at the ends can find."""
    run = tmp_path / "run"
    key = "controller.localization.gap.x"
    gene = f"+design.genes.gap={{_target_: evoros.design.genes.Gene, key: {key}, low: 0, high: 9}}"
    gap = ["+filter@controller.localization.gap=picky", gene, "optimizer.population_size=8"]
    assert tiny(run, *gap) == DONE, capsys.readouterr().err
    before = content(run)
    missions, table = load_run(run).missions, load_run(run).generations
    refused = missions[missions["ended"] == "refused"]
    assert 0 < len(refused) < len(missions)
    assert refused["reason"].str.contains("must not be between 2 and 4").all()
    values = table.drop_duplicates("id").set_index("id")
    assert values.loc[refused["design"], "gap"].between(2, 4).all()
    assert (values.loc[refused["design"], "fitness"] == 2.0).all()
    assert values["fitness"].max() > 2.0
    assert resume(run) == DONE
    assert content(run) == before


def test_evolved_values_that_a_part_refuses_only_when_it_starts(tmp_path: Path) -> None:
    """The avoidance needs sensors that see as far as it looks, which is known in a mission only."""
    far = (
        "+design.genes.far={_target_: evoros.design.genes.Gene, "
        "key: design.sensors.sonar.range_max_m, low: 1, high: 4.5}"
    )
    assert tiny(tmp_path / "run", far, "optimizer.population_size=8") == DONE
    missions, table = load_run(tmp_path / "run").missions, load_run(tmp_path / "run").generations
    values = table.drop_duplicates("id").set_index("id")
    refused = missions["ended"] == "refused"
    assert set(refused) == {True, False}
    looks = build_tiny().controller.avoidance.range_m  # type: ignore[union-attr]
    assert (refused == (values.loc[missions["design"], "far"].to_numpy() < looks)).all()


@cache
def build_tiny(*more: str) -> Experiment:
    return compose(["experiment=tiny", "executor=serial", *more], config_dir=USER_PARTS).build()


@pytest.mark.parametrize("fitness", [EquationOne(), WorstCase(EquationOne())])
def test_a_trial_has_the_stated_number_of_scores(fitness: Fitness) -> None:
    experiment = replace(build_tiny(), fitness=fitness)
    trial = [(example_outcome(0.5),) for _ in experiment.world]
    assert len(experiment.scoring.score_missions(trial)) == experiment.scored_missions


@pytest.mark.parametrize("name", ["a/b", "", "a b", "ü", "..", "a;b", "a,b", 'a"b', 7, None])
def test_names_that_make_no_file_or_column_are_refused(name: Any) -> None:
    """Else a run of days would end in an error when the champion's trajectories are written."""
    experiment = build_tiny()
    far = experiment.world["far"]
    with pytest.raises(InputError, match=r"^world: the key of each world must be a name"):
        replace(experiment, world={"near-2_B": far, name: far})
    gene = Gene("controller.avoidance.range_m", 3, 4)
    with pytest.raises(InputError, match=r"^(SensorDesign\.|design\.)genes: "):
        replace(experiment, design=replace(experiment.design, genes={name: gene}))


@given(st.lists(st.text("abAB", min_size=1, max_size=3), unique=True))
def test_names_that_differ_in_case_alone_are_refused(names: list[str]) -> None:
    if len({name.lower() for name in names}) == len(names):
        check_case("world", names)
        return
    with pytest.raises(InputError, match=r"^world: .* differ only in upper and lower case"):
        check_case("world", names)
