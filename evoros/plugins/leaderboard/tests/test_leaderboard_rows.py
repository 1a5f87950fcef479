"""The submitted rows of the leaderboard: each run counts once, and CI runs new ones again."""

import os
import shutil
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from helpers import ROOT

import evoros
from evoros.plugins.leaderboard.rows import PREFIX, TASKS, make_row, read_rows, write_rows

FILE = Path("benchmarks") / "leaderboard.csv"
SCRIPT = Path(".ci") / "leaderboard"


def test_each_run_has_one_row_within_the_budget() -> None:
    rows = read_rows(ROOT / FILE)
    assert all(count == 1 for count in Counter(row.name for row in rows).values())
    for row in rows:
        assert int(row.missions) <= TASKS[PREFIX + row.task]
        assert float(row.low) <= float(row.fitness) <= float(row.high)
        assert f"experiment={PREFIX}{row.task}" in row.overrides.split()


def git(folder: Path, *words: str) -> None:
    named = ("-c", "user.name=A", "-c", "user.email=a@example.org")
    subprocess.run(["git", *named, *words], cwd=folder, check=True, capture_output=True)


def check(folder: Path) -> "subprocess.CompletedProcess[str]":
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path}
    command = [str(folder / SCRIPT), "HEAD"]
    return subprocess.run(command, env=environment, capture_output=True, text=True)


@pytest.mark.slow
def test_ci_runs_new_rows_alone_and_stops_at_a_forged_one(tmp_path: Path) -> None:
    run = tmp_path / "run"
    few = "optimizer=random_search optimizer.population_size=2 optimizer.generations=1 seed=5"
    quick = "final_choice=none executor=serial figures=[] record=none"
    evoros.run(["experiment=benchmark_boxes", *few.split(), *quick.split()], run)
    row = make_row(run)
    clone = tmp_path / "clone"
    for file in (SCRIPT, FILE):
        (clone / file).parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(ROOT / SCRIPT, clone / SCRIPT)
    old = replace(row, seed="1", digest="0" * 64)  # of an earlier commit: it is not run again
    (clone / FILE).write_text(write_rows([old]))
    git(clone, "init", "-q")
    git(clone, "add", ".")
    git(clone, "commit", "-qm", "rows")
    assert check(clone).returncode == 0
    (clone / FILE).write_text(write_rows([old, replace(row, completed="1.00", digest="1" * 64)]))
    failed = check(clone)
    assert failed.returncode == 1
    assert "line 3 (boxes, random_search, seed 5)" in failed.stderr
