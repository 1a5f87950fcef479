from pathlib import Path

import numpy as np
import pytest
from fakes import OWN, content, tiny

from evoros.cli import DONE, evoros
from evoros.config import build, compose
from evoros.evaluation import fitness_of
from evoros.rng import generator
from evoros.runs import load_run


@pytest.mark.parametrize("draws", ["generation", "individual", "run"])
def test_the_same_bytes_for_any_number_of_workers(draws: str, tmp_path: Path) -> None:
    more = [f"draws={draws}", "trials=2"]
    assert tiny(tmp_path / "serial", *more) == DONE
    for workers in (1, 3):
        run = tmp_path / f"{workers}"
        assert tiny(run, *more, "executor=processes", f"executor.workers={workers}") == DONE
        assert content(run) == content(tmp_path / "serial")


def test_the_same_bytes_in_pybullet_too(tmp_path: Path) -> None:
    short = ["optimizer.generations=2", "optimizer.population_size=3", "world=boxes", "seed=3"]
    short += ["world.boxes.course.time_limit_s=4", "optimizer.validation_trials=1"]
    one, two = tmp_path / "one", tmp_path / "two"
    assert evoros([*short, "executor=serial", f"hydra.run.dir={one}"]) == DONE
    assert evoros([*short, "executor.workers=2", f"hydra.run.dir={two}"]) == DONE
    assert content(one) == content(two)


def test_another_seed_is_another_run(tmp_path: Path) -> None:
    for seed in range(2):
        assert tiny(tmp_path / f"{seed}", f"seed={seed}", "optimizer.generations=1") == DONE
    first, second = (load_run(tmp_path / f"{seed}").generations for seed in range(2))
    assert not set(first["sensor0_x_m"]) & set(second["sensor0_x_m"])


def test_the_tables_tell_the_run_again(tmp_path: Path) -> None:
    """Fitness follows from the missions, designs from the search, the champion from both."""
    run = tmp_path / "run"
    assert tiny(run, "trials=2") == DONE
    experiment = build(compose(["experiment=tiny", "executor=serial", "trials=2"], OWN))
    from evoros.record import RunFolder

    with RunFolder(run) as folder:
        outcomes = {place: outcome for place, (_, outcome) in folder.outcomes.items()}
    table = load_run(run).generations
    search = experiment.optimizer.start(experiment.space, generator("0", "optimizer"))
    for number in range(experiment.optimizer.generations):
        asked = search.ask()
        scores = []
        for one in asked:
            design = experiment.space.decode(one.genome)
            missions = experiment.plan.selection(number, one.id, design)
            scores.append(fitness_of(experiment.fitness, missions, outcomes))
        candidates = search.tell(scores)
        rows = table[table["generation"] == number]
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
    assert tiny(tmp_path / "run") == DONE
    run = load_run(tmp_path / "run")
    of_champion = run.missions["design"] == run.champion["design"][0]
    missions = run.missions[of_champion & (run.missions["purpose"] == "selection")]
    assert set(missions["world"]) == {"near", "far"}
    for row in missions.itertuples():
        track = run.trajectory(str(row.world))
        assert track["time_s"].iloc[-1] == row.time_s
        assert track["visited"].iloc[-1] == row.visited
        steps = np.diff(track[["x_m", "y_m"]].to_numpy(), axis=0)
        assert np.sqrt((steps * steps).sum(axis=1)).sum() == row.distance_m


def test_validation_never_enters_selection(tmp_path: Path) -> None:
    """The same search with more validation: every fitness stays, only the validated ones change."""
    for trials in (0, 2):
        assert tiny(tmp_path / f"{trials}", f"optimizer.validation_trials={trials}") == DONE
    without, with_it = (load_run(tmp_path / f"{trials}") for trials in (0, 2))
    same = [name for name in without.generations if name != "validated_fitness"]
    assert without.generations[same].equals(with_it.generations[same])
    assert without.generations["validated_fitness"].isna().all()
    best = with_it.generations.loc[with_it.generations.groupby("generation")["fitness"].idxmax()]
    assert best["validated_fitness"].notna().all()
    draws = with_it.missions.groupby("purpose")["draws"].agg(set)
    assert not draws["selection"] & draws["validation"]


def test_wall_clock_figures_stay_out_of_the_tables(tmp_path: Path) -> None:
    for pause in (0.0, 0.02):
        more = ["optimizer.generations=1", f"simulator.pause_s={pause}"]
        assert tiny(tmp_path / f"{pause}", *more) == DONE
    assert content(tmp_path / "0.0") == content(tmp_path / "0.02")


def test_every_bundled_experiment_builds() -> None:
    for name in ("quickstart", "case_study", "free_placement", "as_run"):
        assert build(compose([f"experiment={name}"])).world


@pytest.mark.parametrize("failure", ["none", "random", "spatial", "combined"])
@pytest.mark.parametrize("controller", ["rover", "rover_l1"])
def test_groups_of_parts_combine(failure: str, controller: str) -> None:
    experiment = build(compose([f"failure={failure}", f"controller={controller}"]))
    assert experiment.optimizer.generations == 25
