"""Runs in which survivors and the better designs get further trials."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import USER_PARTS, content, cut, resume, tiny

from evoros import load_run, replay
from evoros.mission.plan import POLICIES
from evoros.session.rebuilding import rebuild
from evoros.session.replay import replay_designs
from evoros.terminal.console import DONE

SLOW = (pytest.param(name, marks=pytest.mark.slow) for name in ("halving", "successive_rejects"))
PLACE = ["generation", "design", "world", "trial"]


@pytest.fixture(scope="module", params=["lifelong", "racing", *SLOW])
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp(request.param) / "run"
    assert tiny(folder, f"allocation={request.param}", "optimizer.generations=4") == DONE
    return folder


def scores(missions: Any) -> Any:
    """The score of each trial by Eq. 1, computed from the table alone."""
    progress = (1 + missions.progress) ** 2
    left = np.where(missions.completed, (2 - missions.time_s / missions.time_limit_s) ** 2, 0.0)
    trial = [missions[name] for name in ("generation", "design", "trial")]
    return (progress + left).groupby(trial).sum().rename("score")


@pytest.mark.slow
def test_trials_are_counted_and_no_draw_is_met_twice(run: Path) -> None:
    loaded: Any = load_run(run)
    selection = loaded.missions[loaded.missions.purpose == "selection"]
    assert not selection.duplicated(["design", "world", "draws"]).any()
    assert not loaded.missions.duplicated(PLACE).any()
    counted = selection[selection.world == selection.world.iloc[0]]
    for generation, table in loaded.generations.groupby("generation"):
        so_far = counted[counted.generation <= generation].groupby("design").size()
        assert (table.set_index("id").trials == so_far.reindex(table.id)).all()
    assert loaded.generations.trials.max() > 1


def test_fitness_is_at_most_the_mean_over_the_life_and_that_of_the_best_is_it(run: Path) -> None:
    loaded: Any = load_run(run)
    by_trial = scores(loaded.missions[loaded.missions.purpose == "selection"]).reset_index()
    for generation, table in loaded.generations.groupby("generation"):
        life = by_trial[by_trial.generation <= generation].groupby("design").score.mean()
        assert (table.fitness.to_numpy() <= life[table.id].to_numpy() + 1e-9).all()
        best = table.loc[table.fitness.idxmax()]
        assert best.fitness == pytest.approx(life[best.id])


@pytest.mark.slow
def test_the_same_bytes_after_a_cut_and_when_extended(run: Path, tmp_path: Path) -> None:
    whole = content(run)
    name = run.parent.name.rstrip("0123456789")
    short = tmp_path / "short"
    assert tiny(short, f"allocation={name}", "optimizer.generations=2") == DONE
    assert resume(short, "optimizer.generations=4") == DONE
    assert content(short) == whole
    cut(short, int(len(whole["missions.csv"].encode()) * 0.75))
    assert resume(short) == DONE
    assert content(short) == whole


def test_designs_and_missions_of_later_rounds_are_replayed(run: Path) -> None:
    loaded: Any = load_run(run)
    designs = replay_designs(loaded, rebuild(run, (), USER_PARTS).experiment)
    assert set(loaded.generations.id) <= set(designs)
    selection = loaded.missions[loaded.missions.purpose == "selection"]
    later = selection.loc[selection.groupby("design").generation.idxmax()]
    row = later.sort_values("trial").iloc[-1]
    key = int(row.generation), int(row.design), str(row.world), int(row.trial)
    (outcome,), _ = replay(run, key, config_dir=USER_PARTS)
    assert (outcome.ended, outcome.time_s) == (row.ended, row.time_s)


@pytest.mark.parametrize("draws", POLICIES)
def test_a_generation_shares_its_draws_by_the_policy(draws: str, tmp_path: Path) -> None:
    more = ["allocation=lifelong", f"draws={draws}", "optimizer.generations=4"]
    assert tiny(tmp_path / "run", *more) == DONE
    missions: Any = load_run(tmp_path / "run").missions
    selection = missions[missions.purpose == "selection"]
    assert not selection.duplicated(["design", "world", "draws"]).any()
    kinds = selection.groupby(["generation", "world", "trial"]).draws.nunique()
    if draws == "generation":
        assert kinds.max() == 1
    elif draws == "individual":
        assert kinds.max() > 1


@pytest.mark.slow
def test_confirmed_survivors_are_scored_again_in_both_simulators(tmp_path: Path) -> None:
    more = ["allocation=lifelong", "confirmation=strict", "optimizer.population_size=6"]
    assert tiny(tmp_path / "run", *more) == DONE
    run: Any = load_run(tmp_path / "run")
    last = run.generations[run.generations.generation == run.generations.generation.max()]
    confirmed = last.dropna(subset="loss").drop_duplicates("id")
    counts = run.missions[run.missions.purpose == "confirmation"].groupby("design").size() / 2
    assert (confirmed.set_index("id").trials == counts.reindex(confirmed.id)).all()
    assert confirmed.trials.max() > 1
    difference = confirmed.screened_fitness - confirmed.loss - confirmed.fitness
    assert difference.abs().max() < 1e-12
    selected = run.missions[run.missions.purpose == "selection"].set_index(["design", "world"])
    again = run.missions[run.missions.purpose == "confirmation"]
    for row in again.itertuples():
        assert row.draws.replace("confirmation", "selection") in set(
            selected.loc[[(row.design, row.world)]].draws
        )
