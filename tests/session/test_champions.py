"""A run records all that its search has found, and an evaluation scores it."""

from pathlib import Path

import pandas as pd
import pytest
from helpers import TINY, everything, resume, tiny

from evoros.base.console import DONE
from evoros.cli.evaluate import evaluate

SEARCH = (
    "optimizer=map_elites",
    "optimizer.population_size=4",
    "optimizer.validation_trials=0",
    "~optimizer.mutation_probability",
)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Path:
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


def test_the_champions_are_the_elites_best_first(found: Path) -> None:
    scores, elites = pd.read_csv(found / "champions" / "scores.csv"), read_elites(found)
    assert len(scores) > 1
    pd.testing.assert_frame_equal(scores, elites[list(scores.columns)])
    designs = pd.read_csv(found / "champions" / "design.csv")
    assert list(designs.design.unique()) == list(scores["id"])
    champion = pd.read_csv(found / "champion" / "design.csv")
    first = designs[designs.design == scores["id"][0]].reset_index(drop=True)
    pd.testing.assert_frame_equal(first, champion)


def test_an_evaluation_scores_all_of_them(found: Path, tmp_path: Path) -> None:
    given = [*TINY, "executor=serial", f"designs={found}/champions/design.csv"]
    assert evaluate([*given, f"hydra.run.dir={tmp_path}/again"]) == DONE
    missions = pd.read_csv(tmp_path / "again" / "missions.csv")
    assert missions.design.nunique() == len(pd.read_csv(found / "champions" / "scores.csv"))


def test_a_resumed_run_changes_nothing_and_a_longer_one_has_its_own(
    found: Path, tmp_path: Path
) -> None:
    before = everything(found)
    assert resume(found) == DONE
    assert (found / "champions" / "scores.csv").is_file()
    changed = {path for path, content in everything(found).items() if before.get(path) != content}
    assert {Path(path).name for path in changed} <= {"status.json", "evoros.log"}
    assert resume(found, "optimizer.generations=4") == DONE
    assert tiny(tmp_path / "whole", *SEARCH, "optimizer.generations=4") == DONE
    for name in ("scores.csv", "design.csv", "genes.csv"):
        longer = (found / "champions" / name).read_bytes()
        assert longer == (tmp_path / "whole" / "champions" / name).read_bytes()
    scores, elites = pd.read_csv(found / "champions" / "scores.csv"), read_elites(found)
    pd.testing.assert_frame_equal(scores, elites[list(scores.columns)])
