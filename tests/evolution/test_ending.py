"""How a run ends: its final choice, and the certificate of its champion."""

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fixture_types import Capture, Folders
from helpers import USER_PARTS, content, copied, cut, finished_run, resume, tiny
from proposal_sites import is_of

from evoros import load_run, replay
from evoros.base.combining import mean
from evoros.certificate.rates import bound_mean
from evoros.certificate.validation import Validation
from evoros.cli import summary
from evoros.evolution.loop import Judgement
from evoros.evolution.trials import FreshTrials
from evoros.mission.mission import COMPLETED
from evoros.terminal.console import DONE, INPUT
from evoros.testing.subjects import example_outcome

FINAL = ("final_choice=halving", "final_choice.finalists=5", "final_choice.method.budget=4")
PRECISE = ("validation.precision=2", "validation.trials=3", "validation.max_trials=12")
MORE = (*FINAL, *PRECISE, "validation.rivals=2", "trials=2")


@pytest.fixture(scope="module")
def run(tmp_path_factory: Folders) -> Path:
    return finished_run(tmp_path_factory.mktemp("ending") / "run", *MORE)


def certificate(run: Path) -> Any:
    return json.loads((run / "champion" / "certificate.json").read_text())


def test_every_run_ends_with_a_certificate_that_costs_no_mission(tmp_path: Path) -> None:
    assert tiny(tmp_path / "run", "optimizer.validation_trials=3") == DONE
    loaded: Any = load_run(tmp_path / "run")
    stated = certificate(tmp_path / "run")
    last = loaded.generations[loaded.generations.generation == 2]
    best = last.loc[last.fitness.idxmax()]
    assert stated["design"] == best.id
    assert stated["recorded_fitness"] == best.fitness == loaded.status["best_fitness"]
    assert stated["validated_fitness"] == best.validated_fitness
    assert stated["validated_trials"] == loaded.status["validated_trials"] == 3
    assert stated["fitness_low"] < stated["validated_fitness"] < stated["fitness_high"]
    validated = loaded.missions[loaded.missions.purpose == "validation"]
    assert {rival["design"] for rival in stated["rivals"]} == set(validated.design) - {best.id}
    completed = validated[validated.design == best.id].groupby("world").completed.sum()
    assert {world: rate["completed"] for world, rate in stated["worlds"].items()} == dict(completed)


def test_the_interval_reaches_as_far_as_the_fitness_can() -> None:
    """Missions that go much better than any seen are allowed for, unless there is no maximum."""
    scores = [10.0, 10.1, 10.2]

    def bound(*fitness_bounds: float) -> tuple[float, float]:
        experiment = SimpleNamespace(
            fitness_bounds=fitness_bounds,
            validation=Validation(),
            scoring=SimpleNamespace(combine=mean),
        )
        outcomes = {"hall": [example_outcome(1.0, COMPLETED)]}
        fresh = {0: FreshTrials(scores, scores, 1.0, outcomes)}
        validated: Any = SimpleNamespace(trials=SimpleNamespace(experiment=experiment), fresh=fresh)
        champion: Any = SimpleNamespace(id=0)
        return Judgement(validated, champion).bound(0, 0.95)

    assert bound(1.0, 24.0) == bound_mean(scores, 1.0, 24.0, 0.95)
    assert max(scores) < bound()[1] < bound(1.0, 24.0)[1]


def test_without_validation_a_certificate_says_nothing(tmp_path: Path) -> None:
    stated = certificate(finished_run(tmp_path / "run", "optimizer.validation_trials=0"))
    assert stated["validated_trials"] == 0
    assert stated["validated_fitness"] is stated["fitness_low"] is stated["rival_advantage"] is None


@pytest.mark.slow
def test_the_champion_is_a_finalist_and_the_best_of_the_last_round(run: Path) -> None:
    loaded: Any = load_run(run)
    stated, missions = certificate(run), loaded.missions
    assert set(loaded.champion.design) == {stated["design"]} == {stated["finalists"][0]["design"]}
    ranked = loaded.generations.groupby("id").fitness.last().sort_values(ascending=False)
    entered = sorted((finalist["fitness"] for finalist in stated["finalists"]), reverse=True)
    assert entered == ranked.tolist()[:5]
    final = missions[missions.purpose == "final"].groupby("design").size() / 2  # worlds
    assert {finalist["design"]: finalist["trials"] for finalist in stated["finalists"]} == dict(
        final
    )
    most = [finalist for finalist in stated["finalists"] if finalist["trials"] == final.max()]
    assert stated["recorded_fitness"] == max(finalist["final_fitness"] for finalist in most)


def test_each_purpose_has_draws_and_trials_of_its_own(run: Path) -> None:
    missions: Any = load_run(run).missions
    assert set(missions.purpose) == {"selection", "validation", "final"}
    assert not missions.duplicated(["generation", "design", "world", "trial"]).any()
    assert not missions.duplicated(["design", "world", "draws"]).any()
    assert missions.groupby("draws").purpose.nunique().max() == 1
    shared = missions[missions.purpose != "selection"].groupby(["purpose", "trial", "world"])
    assert shared.draws.nunique().max() == 1


def test_trials_are_added_until_the_precision_or_the_limit(run: Path) -> None:
    stated = certificate(run)
    half_width = (stated["fitness_high"] - stated["fitness_low"]) / 2
    assert 3 <= stated["validated_trials"] <= 12
    if half_width > 2:
        assert stated["validated_trials"] == 12 < stated["precision_trials"]
    else:
        assert stated["precision_trials"] is None
    assert all(rate["trials"] == stated["validated_trials"] for rate in stated["worlds"].values())
    assert len(stated["rivals"]) >= 2
    led = {rival["design"] for rival in stated["rivals"] if rival["led"]}
    ranked = load_run(run).generations.sort_values("fitness", ascending=False, kind="stable")
    assert led <= set(ranked.drop_duplicates("generation")["id"])
    assert len(stated["rivals"]) - len(led) <= 2  # validation.rivals


def test_no_rival_of_a_certificate_is_better_by_more_than_it_states(run: Path) -> None:
    stated = certificate(run)
    assert all(rival["low"] <= rival["fitness"] <= rival["high"] for rival in stated["rivals"])
    highest = max(rival["high"] for rival in stated["rivals"])
    assert stated["rival_advantage"] == pytest.approx(highest - stated["fitness_low"], abs=2e-6)
    assert load_run(run).status["rival_advantage"] == stated["rival_advantage"]


def summarize(run: Path, folder: Path, **changes: object) -> str:
    """Return the summary of the run with a changed certificate."""
    copied(run, folder)
    file = folder / "champion" / "certificate.json"
    file.write_text(json.dumps({**certificate(run), **changes}))
    return summary.summarize(folder)


def make_rival(design: int, low: float, high: float) -> dict[str, object]:
    fitness = (low + high) / 2
    return {
        "design": design,
        "trials": 5,
        "fitness": fitness,
        "low": low,
        "high": high,
        "led": True,
    }


@pytest.mark.parametrize(
    ("ends", "advantage", "said"),
    [
        ([(4, 9), (3, 10)], 3.21, "none of 2 is shown to be better; design 1 may be better by up"),
        ([(4, 9), (8.5, 10)], 3.21, "design 1 is better by at least 0.50; "),
        ([(4, 9)], None, "but there is no interval for a comparison"),
        ([], None, "none tested on the same draws"),
    ],
)
def test_the_summary_says_whether_a_rival_is_better(
    ends: list[tuple[float, float]], advantage: float | None, said: str, run: Path, tmp_path: Path
) -> None:
    changes: dict[str, object] = {"fitness_low": 7.0, "fitness_high": 8.0, "finalists": []}
    changes["rivals"] = [make_rival(design, *pair) for design, pair in enumerate(ends)]
    text = summarize(run, tmp_path / "run", **changes, rival_advantage=advantage)
    (line,) = (line for line in text.splitlines() if line.startswith("rivals "))
    assert said in line
    halving = "evoros/cli/summary.py final_choice=halving"
    assert is_of(line, halving) == said.startswith("design 1 is better")
    changes["finalists"] = certificate(run)["finalists"]  # the run has typed what is proposed
    text = summarize(run, tmp_path / "again", **changes, rival_advantage=advantage)
    assert not is_of(text, halving)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"precision": None}, "in 5 fresh trials (95 % interval 7.0 to 9.4)"),
        ({"precision": 1.5, "precision_trials": None}, "on the draws used for selection"),
        ({"precision": 0.1, "precision_trials": 420}, "not reached; a new run with validation."),
        ({"precision": 0.1, "precision_trials": None}, "precision 0.1 cannot be reached"),
    ],
)
def test_the_summary_says_how_the_interval_becomes_narrower(
    changes: dict[str, object], said: str, run: Path, tmp_path: Path
) -> None:
    stated = {"fitness_low": 7.0, "fitness_high": 9.4, "validated_trials": 5, **changes}
    text = summarize(run, tmp_path / "run", **stated)
    (line,) = (line for line in text.splitlines() if line.startswith("fitness "))
    assert said in line
    assert changes["precision"] != 1.5 or line.endswith(said)


def test_a_run_with_the_trials_that_are_proposed_reaches_the_precision(tmp_path: Path) -> None:
    text = summary.summarize(finished_run(tmp_path / "few", *PRECISE))
    assert is_of(text, "evoros/cli/summary.py validation.max_trials={wanted}")
    (typed,) = re.findall(r"validation\.max_trials=\d+", text)
    more = summary.summarize(finished_run(tmp_path / "more", *PRECISE, typed))
    assert "precision" not in more


@pytest.mark.parametrize(
    ("simulators", "named"),
    [
        (["evoros.simulator.planar.Planar"], True),
        (["evoros.simulator.planar.Planar", "evoros.simulator.mujoco.Mujoco"], False),
        (["evoros.simulator.mujoco.Mujoco"], False),
    ],
)
def test_the_summary_of_a_run_in_the_plane_alone_says_how_to_check_it_in_physics(
    simulators: list[str], named: bool, run: Path, tmp_path: Path
) -> None:
    folder = copied(run, tmp_path / "a run")
    file = folder / "manifest.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "simulators": simulators}))
    command = f"evoros evaluate 'like=\"{folder}\"' trials=5 simulator=physics"
    assert (command in summary.summarize(folder)) == named


@pytest.mark.slow
def test_the_same_bytes_after_a_cut_and_in_processes(run: Path, tmp_path: Path) -> None:
    size = len((run / "missions.csv").read_bytes())
    for share, executor in ((0.5, ("executor=processes", "executor.workers=1")), (0.9, ())):
        part = copied(run, tmp_path / f"{share}")
        cut(part, int(size * share))
        assert resume(part, *executor) == DONE
        assert content(part) == content(run)


@pytest.mark.slow
def test_an_extended_run_chooses_again_and_keeps_the_missions_of_before(
    run: Path, tmp_path: Path
) -> None:
    part = copied(run, tmp_path / "longer")
    assert resume(part, "optimizer.generations=5") == DONE
    assert tiny(tmp_path / "whole", *MORE, "optimizer.generations=5") == DONE
    longer, whole, before = (content(folder) for folder in (part, tmp_path / "whole", run))
    for name in whole:
        if name not in ("missions.csv", "champion/certificate.json"):
            assert longer[name] == whole[name], name
    rows = [set(files["missions.csv"].splitlines()) for files in (longer, whole, before)]
    assert rows[0] == rows[1] | rows[2]
    status: Any = load_run(part).status
    assert status["missions"] == len(rows[0]) - 1
    assert certificate(part)["design"] == certificate(tmp_path / "whole")["design"]


def test_a_mission_of_the_final_choice_is_replayed(run: Path) -> None:
    missions: Any = load_run(run).missions
    row = missions[missions.purpose == "final"].iloc[-1]
    place = int(row.generation), int(row.design), str(row.world), int(row.trial)
    (outcome,), _ = replay(run, place, config_dir=USER_PARTS)
    assert (outcome.ended, outcome.time_s) == (row.ended, row.time_s)


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        ("validation.precision=-1", "precision"),
        ("validation.precision=0.001", "validation.max_trials="),
        ("validation.rivals=some", "rivals"),
        ("final_choice=halving final_choice.finalists=0", "finalists"),
        ("final_choice=halving final_choice.method.budget=0", "budget"),
        ("allocation=racing allocation.level=1", "level"),
    ],
)
def test_bad_input_is_one_line(bad: str, said: str, tmp_path: Path, capsys: Capture) -> None:
    assert tiny(tmp_path / "run", *bad.split()) == INPUT
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert said in lines[0]
    assert not (tmp_path / "run").exists()
