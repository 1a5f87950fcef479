"""How a run ends: its final choice, and the certificate of its champion."""

import json
from pathlib import Path
from typing import Any

import pytest
from helpers import USER_PARTS, content, copied, cut, finished_run, resume, tiny

from evoros import load_run, replay
from evoros.cli.summary import summarize_run
from evoros.terminal.console import DONE, INPUT

FINAL = ("final_choice=halving", "final_choice.finalists=5", "final_choice.method.budget=4")
PRECISE = ("validation.precision=0.4", "validation.first=3", "validation.max_trials=12")
MORE = (*FINAL, *PRECISE, "validation.rivals=2", "trials=2")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ending") / "run"
    assert tiny(folder, *MORE) == DONE
    return folder


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


def test_without_validation_a_certificate_says_nothing(tmp_path: Path) -> None:
    stated = certificate(finished_run(tmp_path / "run", "optimizer.validation_trials=0"))
    assert stated["validated_trials"] == 0
    assert (
        stated["validated_fitness"] is stated["fitness_low"] is stated["chance_of_better"] is None
    )


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
    assert half_width <= 0.4 + 1e-5 or stated["validated_trials"] == 12
    assert all(rate["trials"] == stated["validated_trials"] for rate in stated["worlds"].values())
    assert len(stated["rivals"]) >= 2
    led = {rival["design"] for rival in stated["rivals"] if rival["led"]}
    ranked = load_run(run).generations.sort_values("fitness", ascending=False, kind="stable")
    assert led <= set(ranked.drop_duplicates("generation")["id"])
    assert len(stated["rivals"]) - len(led) <= 2  # validation.rivals


@pytest.mark.parametrize(
    ("led", "chance", "said"),
    [
        ([True, True, False], 0.25, "chance 0.25, among 2 that led a generation and 1 next best"),
        ([False], 0.5, "chance 0.50, among 1 next best"),
        ([True], None, "one trial on fresh draws is too few"),
        ([], None, "no other design met the same draws"),
    ],
)
def test_the_summary_says_which_designs_the_chance_covers(
    led: list[bool], chance: float | None, said: str, run: Path, tmp_path: Path
) -> None:
    folder = copied(run, tmp_path / "run")
    rivals = [{**certificate(run)["rivals"][0], "led": leads} for leads in led]
    changed = {**certificate(run), "rivals": rivals, "chance_of_better": chance}
    (folder / "champion" / "certificate.json").write_text(json.dumps(changed))
    (line,) = (line for line in summarize_run(folder).splitlines() if "a better design" in line)
    assert said in line


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
    command = f"evoros evaluate like='{folder}' simulator=physics trials=5"
    assert (command in summarize_run(folder)) == named


@pytest.mark.parametrize(("gain", "fewer"), [(0.125, 0), (-0.125, 0), (0.125, 1)])
def test_the_summary_says_by_how_much_a_rival_is_better_on_all_of_the_same_draws(
    gain: float, fewer: int, run: Path, tmp_path: Path
) -> None:
    folder, known = copied(run, tmp_path / "run"), certificate(run)
    trials = known["validated_trials"] - fewer
    rival = {"design": 77, "trials": trials, "fitness": known["validated_fitness"] + gain}
    rivals = [{**rival, "chance": 0.5, "led": True}]
    remedies = {False: "final_choice=halving", True: "final_choice.method.budget"}
    for chosen, remedy in remedies.items():
        finalists = [{"design": 77}] * chosen
        changed = {**known, "rivals": rivals, "chance_of_better": 0.5, "finalists": finalists}
        (folder / "champion" / "certificate.json").write_text(json.dumps(changed))
        text = summarize_run(folder)
        assert ("; design 77 scores 0.125 more" in text) == (gain > 0 and not fewer)
        assert (remedy in text) == (gain > 0 and not fewer)


@pytest.mark.slow
def test_the_same_bytes_after_a_cut_and_in_processes(run: Path, tmp_path: Path) -> None:
    size = len((run / "missions.csv").read_bytes())
    processes = ("executor=processes", "executor.workers=2")
    for share, executor in ((0.5, processes), (0.9, ())):
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
        ("validation.rivals=some", "rivals"),
        ("final_choice=halving final_choice.finalists=0", "finalists"),
        ("final_choice=halving final_choice.method.budget=0", "budget"),
        ("allocation=racing allocation.level=1", "level"),
    ],
)
def test_bad_input_is_one_line(
    bad: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert tiny(tmp_path / "run", *bad.split()) == INPUT
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert said in lines[0]
    assert not (tmp_path / "run").exists()
