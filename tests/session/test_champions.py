"""A run records all that its search has found; evaluations score it and look for worst cases."""

import csv
import re
import shlex
from pathlib import Path

import pandas as pd
import pytest
from helpers import TINY, USER_PARTS, copied, everything, resume, tiny
from proposal_sites import is_of

from evoros.analysis.command import evoros_analyze
from evoros.cli.command import evaluate
from evoros.failure.protocol import Case
from evoros.storage.layout import name_parts
from evoros.storage.reading import load_run, read_overrides
from evoros.storage.trajectory_files import robot_file, trajectory_file
from evoros.terminal.console import DONE, INPUT
from evoros.worst_cases.summary import write_command

SEARCH = (
    "optimizer=map_elites",
    "optimizer.population_size=4",
    "optimizer.validation_trials=0",
    "~optimizer.mutation_probability",
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("champions") / "run"
    assert tiny(folder, *SEARCH, "optimizer.generations=2") == DONE
    return folder


def read_elites(run: Path) -> pd.DataFrame:
    """The best design of each of 10 x 10 cells, by the tables of the generations."""
    files = sorted((run / "generations").iterdir())
    rows = pd.concat(map(pd.read_csv, files)).drop_duplicates("id")
    cells = (rows[["descriptors.front", "descriptors.side"]] * 10).astype(int).clip(0, 9)
    rows = rows.assign(cell=[f"{a} {b}" for a, b in cells.to_numpy()])
    ranked = rows.sort_values(["fitness", "id"], ascending=[False, True])
    return ranked.drop_duplicates("cell").reset_index(drop=True)


def test_the_champions_are_the_elites_best_first(run: Path) -> None:
    scores, elites = pd.read_csv(run / "champions" / "scores.csv"), read_elites(run)
    assert len(scores) > 1
    pd.testing.assert_frame_equal(scores, elites[list(scores.columns)])
    designs = pd.read_csv(run / "champions" / "design.csv")
    assert list(designs.design.unique()) == list(scores["id"])
    champion = pd.read_csv(run / "champion" / "design.csv")
    first = designs[designs.design == scores["id"][0]].reset_index(drop=True)
    pd.testing.assert_frame_equal(first, champion)


def kept_files(run: Path) -> set[str]:
    """The trajectories that a run has kept, by their paths in its folder."""
    return {str(path.relative_to(run)) for path in run.glob("trajectories/0*/*.csv")}


@pytest.mark.slow
def test_the_first_missions_of_all_of_them_are_kept_and_no_others(
    run: Path, tmp_path: Path
) -> None:
    loaded = load_run(run)
    missions = loaded.missions.set_index("design", drop=False)
    first = missions.loc[pd.read_csv(run / "champions" / "scores.csv")["id"]]
    assert kept_files(run) == {str(trajectory_file(key_of(row))) for _, row in first.iterrows()}
    for _, row in first.iterrows():
        last = loaded.mission_trajectory(*key_of(row)).iloc[-1]
        assert last.time_s == pytest.approx(row.time_s, abs=0.11)
        assert (run / robot_file(int(row.design))).is_file()
    champion = run / "champion" / "trajectory_near.csv"
    best = missions.loc[[first["design"].iloc[0]]].query("world == 'near'").iloc[0]
    assert (run / trajectory_file(key_of(best))).read_bytes() == champion.read_bytes()
    alone = ("record=champion", "optimizer.generations=2")
    assert tiny(tmp_path / "alone", *SEARCH, *alone) == DONE
    assert not kept_files(tmp_path / "alone")
    again = "evoros/evolution/loop.py record=champion"
    assert is_of((run / "evoros.log").read_text(), again)
    assert not is_of((tmp_path / "alone" / "evoros.log").read_text(), again)


def key_of(row: "pd.Series[str]") -> tuple[int, int, str, int]:
    return int(row["generation"]), int(row["design"]), str(row["world"]), int(row["trial"])


def test_an_evaluation_scores_all_of_them(run: Path, tmp_path: Path) -> None:
    given = [*TINY, "executor=serial", f"designs={run}/champions/design.csv"]
    assert evaluate([*given, f"hydra.run.dir={tmp_path}/again"]) == DONE
    missions = pd.read_csv(tmp_path / "again" / "missions.csv")
    assert missions.design.nunique() == len(pd.read_csv(run / "champions" / "scores.csv"))


@pytest.mark.slow
def test_a_resumed_run_changes_nothing_and_a_longer_one_has_its_own(
    run: Path, tmp_path: Path
) -> None:
    before = everything(run)
    assert resume(run) == DONE
    assert (run / "champions" / "scores.csv").is_file()
    changed = {path for path, content in everything(run).items() if before.get(path) != content}
    assert {Path(path).name for path in changed} <= {"status.json", "evoros.log"}
    assert resume(run, "optimizer.generations=4") == DONE
    assert tiny(tmp_path / "whole", *SEARCH, "optimizer.generations=4") == DONE
    for name in ("scores.csv", "design.csv", "genes.csv"):
        longer = (run / "champions" / name).read_bytes()
        assert longer == (tmp_path / "whole" / "champions" / name).read_bytes()
    kept = everything(run / "trajectories")
    assert kept == everything(tmp_path / "whole" / "trajectories")
    (run / next(path for path in sorted(kept_files(run)))).unlink()
    assert resume(run) == DONE
    assert everything(run / "trajectories") == kept
    scores, elites = pd.read_csv(run / "champions" / "scores.csv"), read_elites(run)
    pd.testing.assert_frame_equal(scores, elites[list(scores.columns)])


DESIGN = "design,sensor,x_m,y_m,yaw_deg\na,0,0.2,0.05,10\na,1,0.2,-0.05,-10\n"
PARTS = ["--config-dir", str(USER_PARTS), "simulator=bicycle", "world=plains", "failure=random"]
SMALL = ["most=2", "times_s=[0.0]", "rounds=1", "population=2", "trials=4", "screening=3"]
"""Settings of a search of a few dozen missions."""


@pytest.fixture(scope="module")
def designs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("worst") / "two.csv"
    path.write_text(DESIGN)
    return path


def look(folder: Path, designs: Path, *more: str) -> int:
    search = [
        "worst_cases=search",
        *(f"worst_cases.{setting}" for setting in SMALL),
        "failure.latest_s=50",
    ]
    typed = [*PARTS, f"designs={designs}", *search, "trials=3", f"hydra.run.dir={folder}", *more]
    return evaluate(typed)


@pytest.fixture(scope="module")
def whole(designs: Path) -> Path:
    folder = designs.parent / "whole"
    assert look(folder, designs, "executor=serial") == DONE
    return folder


def read(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / name).open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_every_case_is_a_mission_that_its_row_describes(whole: Path) -> None:
    missions, cases = read(whole, "missions.csv"), read(whole, "worst_cases.csv")
    assert {row["case"] for row in missions if int(row["trial"]) < 3} == {""}
    stated = [row for row in missions if row["case"]]
    assert {row["case"] for row in stated} == {row["case"] for row in cases if row["case"]}
    for row in stated:
        case = Case.parse(row["case"])
        failed = {int(index) for index in row["failed_sensors"].split(";") if index}
        assert failed <= set(case.sensors)
    for row in cases:
        if row["stage"] in ("nominal", "confirmed"):
            assert row["trials"] == "4"
    assert {row["world"] for row in cases if row["stage"] == "model"} == {"near", "far"}
    assert (whole / "figures" / "worst.pdf").is_file()


@pytest.mark.slow
def test_a_search_that_two_workers_resume_has_the_same_bytes(whole: Path, tmp_path: Path) -> None:
    files = ("missions.csv", "worst_cases.csv", "designs.csv")
    other = copied(whole, tmp_path / "other")
    lines = (other / "missions.csv").read_bytes().splitlines(keepends=True)
    (other / "missions.csv").write_bytes(b"".join(lines[: len(lines) * 2 // 3]))
    for name in ("worst_cases.csv", "designs.csv", "digests.csv"):
        (other / name).unlink()
    assert resume(other, "executor=processes", "executor.workers=2") == DONE
    assert [(other / name).read_bytes() for name in files] == [
        (whole / name).read_bytes() for name in files
    ]


def test_the_printed_command_repeats_the_missions_of_a_case(whole: Path, tmp_path: Path) -> None:
    case = Case((0, 1), (0.0, 0.0))
    (source,) = {row["source"] for row in read(whole, "missions.csv")}
    typed = [*read_overrides(whole), "+requirements.both={survives: 2}"]
    option = name_parts(whole)
    line = write_command(typed, option, source, case, 3)
    assert is_of(line, "evoros/worst_cases/summary.py failure.sensors")
    words = shlex.split(line)
    assert words[:2] == ["evoros", "evaluate"]
    assert not any("worst_cases" in word or "hydra" in word for word in words)
    assert tuple(words[-2:]) == option == ("--config-dir", str(USER_PARTS))
    assert evaluate([f"hydra.run.dir={tmp_path / 'again'}", *words[2:]]) == DONE
    known = {
        (row["world"], row["draws"]): row
        for row in read(whole, "missions.csv")
        if row["case"] == case.text
    }
    again = read(tmp_path / "again", "missions.csv")
    assert len(again) == 6
    for row in again:
        recorded = known[row["world"], row["draws"]]
        same = [name for name in row if name not in ("trial", "digest")]
        assert [row[name] for name in same] == [recorded[name] for name in same]


def test_the_figure_says_what_was_found(whole: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert evoros_analyze(["worst", str(whole), "--output", str(whole / "drawn")]) == DONE
    said = capsys.readouterr().out
    assert "design a of" in said
    model = r"under the run's failure model: share of missions not completed \(\d+ per world\): "
    assert re.search(rf"{model}\w+ \d+ % \(\d+ to \d+\)", said)
    assert "stopped by" in said
    risks = pd.read_csv(whole / "drawn" / "worst_risks.csv")
    assert set(risks["missions"]) == {3}  # the drawn trials alone
    assert set(risks["evaluation"]) == {"random"}


def test_a_run_looks_for_no_worst_cases(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert tiny(tmp_path / "run", "worst_cases=search") == INPUT
    assert "worst_cases: cannot be used in a run" in capsys.readouterr().err
