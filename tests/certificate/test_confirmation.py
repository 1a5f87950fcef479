import json
from collections.abc import Mapping
from pathlib import Path

import pandas as pd
import pytest
from helpers import USER_PARTS, content, copied, cut, finished_run, refusal, resume, tiny
from hypothesis import given
from hypothesis import strategies as st

from evoros import load_run, replay
from evoros.certificate.confirmation import Confirmation
from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.dispatch import dispatcher
from evoros.evolution.experiment import Experiment
from evoros.fitness.scoring import Scoring
from evoros.mission.plan import POLICIES, Plan
from evoros.simulator.mujoco import Mujoco
from evoros.storage.run_folder import RunFolder
from evoros.terminal.console import DONE, STOPPED

STRICT = ("confirmation=strict", "optimizer.population_size=6")
PLACE = ["generation", "design", "world", "trial"]


# Which designs are confirmed -----------------------------------------------------------------

FITNESS = st.floats(0, 24)
PAIRS = st.lists(st.tuples(FITNESS, FITNESS), max_size=12)  # screened and confirmed


def settled(
    screened: Mapping[int, float], truth: Mapping[int, float], best: int
) -> dict[int, float]:
    """The confirmed fitness, if nothing is asked for twice."""
    asked: list[int] = []

    def confirm(some: list[int]) -> dict[int, float]:
        asked.extend(some)
        return {one: truth[one] for one in some}

    confirmed = Confirmation(Mujoco(), best).confirm_best(screened, confirm)
    assert sorted(asked) == sorted(confirmed)
    return confirmed


def ranked(fitness: Mapping[int, float]) -> list[int]:
    """The fittest first; of equals the first."""
    return sorted(fitness, key=lambda one: -fitness[one])


@given(PAIRS, st.integers(1, 5))
def test_the_best_few_are_always_confirmed_ones(
    pairs: list[tuple[float, float]], best: int
) -> None:
    screened = {9 - i: pair[0] for i, pair in enumerate(pairs)}  # ids in any order
    truth = {9 - i: pair[1] for i, pair in enumerate(pairs)}
    confirmed = settled(screened, truth, best)
    assert set(ranked(screened | confirmed)[:best]) <= set(confirmed)
    assert all(confirmed[one] == truth[one] for one in confirmed)
    assert len(confirmed) >= min(best, len(screened))


@given(PAIRS, st.integers(1, 5))
def test_where_nobody_gains_the_best_are_found_and_no_more_is_flown_than_that_takes(
    pairs: list[tuple[float, float]], best: int
) -> None:
    screened = {i: max(pair) for i, pair in enumerate(pairs)}
    truth = {i: min(pair) for i, pair in enumerate(pairs)}
    confirmed = settled(screened, truth, best)
    first = [(screened | confirmed)[one] for one in ranked(screened | confirmed)[:best]]
    assert first == [truth[one] for one in ranked(truth)[:best]]
    assert all(screened[one] >= first[-1] for one in confirmed)


@pytest.mark.parametrize("policy", POLICIES)
def test_a_confirmation_is_the_selection_again_at_places_of_its_own(policy: str) -> None:
    plan, one = Plan(5, ("a", "b"), 3, 4, policy), (2, 9, Design(()))
    selection, confirmation = plan.selection(*one), plan.confirmation(*one)
    assert [(m.world, m.draws) for m in selection] == [(m.world, m.draws) for m in confirmation]
    assert {mission.purpose for mission in confirmation} == {"confirmation"}
    every = [*selection, *confirmation, *plan.validation(*one)]
    assert len({mission.key for mission in every}) == len(every)


# A run ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An uninterrupted run with two trials."""
    return finished_run(tmp_path_factory.mktemp("whole") / "run", *STRICT, "trials=2")


def strict(*more: str) -> Experiment:
    return compose(
        ["experiment=tiny", "executor=serial", *STRICT, *more], config_dir=USER_PARTS
    ).build()


@pytest.mark.slow
def test_each_generations_best_few_have_the_fitness_of_the_confirming_simulator(
    whole: Path,
) -> None:
    """And all others that of the run's own: every column follows from the missions."""
    plan, fitness = strict("trials=2").plan, strict().fitness
    with RunFolder(whole) as folder:
        outcomes = {key: outcome for key, _, outcome in folder.table.read(folder.read_mission)}
    settled = 0
    table = load_run(whole).generations.drop_duplicates("id")  # where each was new
    for generation in range(3):
        rows = table[table["generation"] == generation]
        best = rows.sort_values("fitness", ascending=False, kind="stable")[:2]
        assert best["loss"].notna().all()
        for row in rows.to_dict("records"):
            one = (generation, row["id"], Design(()))
            screened = Scoring(fitness).compute_fitness(plan.selection(*one), outcomes)
            assert row["screened_fitness"] == screened
            again = [m for m in plan.confirmation(*one) if m.key in outcomes]
            assert bool(again) == (row["loss"] == row["loss"])
            if again:
                assert row["fitness"] == Scoring(fitness).compute_fitness(again, outcomes)
                assert row["loss"] == screened - row["fitness"]
                settled += 1
            else:
                assert row["fitness"] == screened
    losses = table["loss"]
    assert settled == losses.notna().sum()
    assert losses.isna().any()
    assert losses.max() > 5
    assert 0 < losses[losses < 5].abs().max() < 1  # by the other step alone


@pytest.mark.slow
def test_every_mission_is_replayed_in_the_simulator_of_its_purpose(whole: Path) -> None:
    missions = load_run(whole).missions
    assert set(missions["purpose"]) == {"selection", "confirmation", "validation"}
    assert not missions.duplicated(PLACE).any()
    alike = missions.pivot_table(
        index=["generation", "design", "world", "draws"], columns="purpose", values="time_s"
    ).dropna(subset="confirmation")
    assert alike["selection"].notna().all()  # the same draws, and another outcome
    assert (alike["selection"] != alike["confirmation"]).any()
    some = missions.groupby("purpose", group_keys=False).head(3)
    for row in some.to_dict("records"):
        generation, design, world, trial = (row[name] for name in PLACE)
        (outcome,), _ = replay(whole, (generation, design, world, trial))
        assert (outcome.ended, outcome.time_s) == (row["ended"], row["time_s"])
        assert outcome.distance_m == row["distance_m"] or row["ended"] == "simulation_failure"


def test_the_champion_drives_in_the_confirming_simulator(whole: Path, tmp_path: Path) -> None:
    """Its trajectories are its confirmation; without one, the search ends where it cannot drive."""
    run = load_run(whole)
    mine = run.missions[run.missions["design"] == run.champion["design"][0]]
    flown = mine[mine["purpose"] == "confirmation"].groupby("world").first()
    assert set(flown.index) == {"near", "far"}
    for row in flown.itertuples():
        track = run.trajectory(str(row.Index))
        assert track["time_s"].iloc[-1] == row.time_s
        steps = track[["x_m", "y_m"]].diff()[1:].to_numpy()
        assert sum(float(x * x + y * y) ** 0.5 for x, y in steps) == pytest.approx(row.distance_m)
    assert set(mine["ended"]) <= {"completed", "time_limit"}
    assert tiny(tmp_path / "run", "optimizer.population_size=6", "trials=2") == DONE
    assert load_run(tmp_path / "run").champion["x_m"].mean() > 0.1 > run.champion["x_m"].mean()


@pytest.mark.parametrize(
    "search",
    [
        ["optimizer=random_search", "~optimizer.mutation_probability"],
        ["optimizer.elite=best_child", "optimizer.generations=6"],
    ],
)
def test_the_best_is_a_confirmed_one_whatever_the_search_keeps(
    search: list[str], tmp_path: Path
) -> None:
    assert tiny(tmp_path / "run", *STRICT, *search) == DONE
    run = load_run(tmp_path / "run")
    for _, table in run.generations.groupby("generation"):
        best = table[table["loss"].notna()]["fitness"].max()
        validated = table[table["validated_fitness"].notna()]
        assert best in set(validated["fitness"])
    last = table.set_index("id").loc[[run.champion["design"][0]]].iloc[0]
    assert last["fitness"] == best == run.status["best_fitness"]
    assert last["loss"] == run.status["best_loss"]


@pytest.mark.slow
def test_without_a_loss_it_is_the_run_without_a_confirmation(tmp_path: Path) -> None:
    same = ["confirmation.simulator._target_=planar.Planar", "~confirmation.simulator.most_x_m"]
    same += ["confirmation.simulator.time_step=0.05", "confirmation.best=1"]
    assert tiny(tmp_path / "with", *STRICT, *same) == DONE
    assert tiny(tmp_path / "without", *STRICT[1:]) == DONE
    confirmed, plain = load_run(tmp_path / "with"), load_run(tmp_path / "without")
    pd.testing.assert_frame_equal(
        confirmed.generations.drop(columns=["screened_fitness", "loss"]), plain.generations
    )
    losses = confirmed.generations.groupby("generation")["loss"]
    assert (losses.count() > 0).all()
    assert set(confirmed.generations["loss"].dropna()) == {0.0}
    shared = confirmed.missions[confirmed.missions["purpose"] != "confirmation"]
    assert len(shared) == len(plain.missions)
    both = [content(tmp_path / name) for name in ("with", "without")]
    one, other = ({k: v for k, v in files.items() if "champion" in k} for files in both)
    assert one == other


def test_without_a_confirmation_the_tables_have_no_columns_of_it(tmp_path: Path) -> None:
    assert tiny(tmp_path / "run", "optimizer.generations=1", "confirmation=none") == DONE
    run = load_run(tmp_path / "run")
    assert not {"screened_fitness", "loss"} & set(run.generations)
    assert (run.status["best_loss"], run.status["confirmed"]) == (None, 0)


# Interruptions -------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_run_that_was_cut_ends_with_the_same_bytes(whole: Path, tmp_path: Path) -> None:
    run = copied(whole, tmp_path / "run")
    rows = (run / "missions.csv").read_bytes()
    cut(run, len(rows) // 2)
    kept = (run / "missions.csv").read_bytes().count(b"\n") - 1
    assert resume(run, "executor=serial") == DONE
    assert content(run) == content(whole)
    assert load_run(run).status["session_missions"] == rows.count(b"\n") - 1 - kept


@pytest.mark.slow
def test_a_run_that_stops_in_the_confirming_simulator_goes_on(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The fault is real and happens once, in a confirmation: nothing else opens that simulator."""
    monkeypatch.setattr(dispatcher, "MISSIONS_OUT", 1)  # larger calls would be repeated
    run = tmp_path / "run"
    fault = ["confirmation.simulator.fault=raise", f"confirmation.simulator.mark={tmp_path}/mark"]
    assert tiny(run, *STRICT, "trials=2", *fault) == STOPPED
    assert set(load_run(run).missions["purpose"]) <= {"selection", "confirmation"}
    assert resume(run) == DONE
    assert content(run) == content(whole)


@pytest.mark.slow
def test_extending_goes_on_with_the_confirmed_fitness(whole: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    assert tiny(run, *STRICT, "trials=2", "optimizer.generations=1") == DONE
    assert resume(run, "optimizer.generations=3") == DONE
    assert content(run) == content(whole)


# What is said, and what is refused -----------------------------------------------------------


def test_the_loss_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str], whole: Path) -> None:
    run = copied(whole, tmp_path / "run")
    capsys.readouterr()
    assert resume(run) == DONE
    table, status = load_run(run).generations, load_run(run).status
    losses = table.drop_duplicates("id")["loss"].dropna()
    assert status["confirmed"] == len(losses)
    assert status["mean_loss"] == pytest.approx(losses.mean(), abs=1e-12)
    best = table[table["id"] == load_run(run).champion["design"][0]]["loss"].iloc[0]
    assert status["best_loss"] == best
    mean = f"{losses.mean():.3f} on average over {len(losses)} confirmed designs"
    said = f"fitness lower by {best:.3f} for the champion, {mean}"
    assert said in capsys.readouterr().out
    assert f", loss {best:.3f}, mean " in (run / "evoros.log").read_text()


def test_the_confirming_simulators_module_is_part_of_the_run(whole: Path) -> None:
    hashed = json.loads((whole / "manifest.json").read_text())["sha256"]
    assert {"module planar", "module strict"} <= set(hashed)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["confirmation.best=0"], "confirmation.best: must be a positive integer"),
        (["confirmation.best=1.5"], "confirmation.best: must be a positive integer"),
        (["confirmation.best=true"], "confirmation.best: must be a positive integer"),
        (
            ["confirmation.simulator=null"],
            "confirmation.simulator: must be an evoros.parts.Simulator",
        ),
        (
            ["confirmation.simulator.time_step=0.03"],
            "confirmation.simulator: controller.period_s: must be a whole multiple of "
            "simulator.time_step (0.03 s)",
        ),
        (["~confirmation._target_"], "confirmation: must be a confirmation"),
    ],
)
def test_what_cannot_confirm_is_refused_before_the_run(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in refusal(tmp_path, capsys, *STRICT, *arguments)


def test_any_simulator_confirms(tmp_path: Path) -> None:
    """A bundled one by its choice, in place of the one that is chosen first."""
    config = compose(["confirmation=physics", "confirmation.best=5"])
    assert isinstance(config.build().confirming.simulator, Mujoco)
    config = compose(
        ["confirmation=physics", "simulator@confirmation.simulator=bicycle", "experiment=tiny"],
        config_dir=USER_PARTS,
    )
    experiment = config.build()
    assert experiment.confirmation
    assert experiment.confirmation.simulator == experiment.simulator
