"""A run records all that its search has found, and an evaluation scores it."""

from pathlib import Path

import pandas as pd
import pytest
from helpers import TINY, everything, resume, tiny
from proposal_sites import is_of

from evoros.cli.command import evaluate
from evoros.storage.reading import load_run
from evoros.storage.trajectory_files import robot_file, trajectory_file
from evoros.terminal.console import DONE

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
