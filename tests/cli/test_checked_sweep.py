"""Sweeps are checked as a whole before the first job begins."""

import re
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fixture_types import Capture, Patch
from helpers import TINY, sweep
from hypothesis import given, settings
from hypothesis import strategies as st
from proposal_sites import is_of

from evoros.analysis.figures.factors import list_tests
from evoros.analysis.statistics.comparison import compare_treatments, conclude
from evoros.analysis.statistics.small_samples import LEVEL
from evoros.analysis.statistics.two_samples import minimum_replicates
from evoros.base.arrays import Array
from evoros.cli.checking import advise_seeds, describe_faults, find_treatment
from evoros.cli.command import evaluate
from evoros.config.jobs import Job, Jobs, RefusedJob
from evoros.session import search
from evoros.terminal.console import DONE, INPUT


@pytest.mark.parametrize(
    ("wrong", "count", "said"),
    [
        ("trials=1,0", 2, "trials=0 (2 of 4 jobs; no job was started): trials: must be "),
        (
            "failure=random,rondom",
            2,
            "failure=rondom (2 of 4 jobs; no job was started): failure: must ",
        ),
        ("fitness._target_=evoros.fitness.Nope,evoros.Nope", 4, "No module named"),
        (
            "optimizer.generations=0",
            2,
            "2 of 2 jobs; no job was started: optimizer.generations: must",
        ),
        (
            "figures=[],[nothing]",
            2,
            "figures=[nothing] (2 of 4 jobs; no job was started): figures: ",
        ),
    ],
)
def test_what_one_job_got_wrong_stops_the_sweep_before_it_starts(
    wrong: str, count: int, said: str, tmp_path: Path, capsys: Capture
) -> None:
    assert sweep(tmp_path / "a sweep", "seed=0,1", wrong) == INPUT
    out, err = capsys.readouterr()
    lines = [line for line in err.splitlines() if line.startswith("evoros: ")]
    assert said in lines[0]
    assert sum(int(re.findall(r"(\d+) of \d+ jobs", line)[0]) for line in lines) == count
    assert not (tmp_path / "a sweep").exists()
    assert not out
    assert "Traceback" not in err


def test_a_misspelt_class_of_the_last_job_is_found_before_a_job_is_built(
    tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.setattr("evoros.cli.checking.check_run", lambda *_: 1 / 0)
    target = "fitness._target_=evoros.fitness.equation_one."
    assert sweep(tmp_path / "a sweep", f"{target}EquationOne,{target[17:]}EquationTwo") == INPUT
    assert "(1 of 2 jobs; no job was started): " in capsys.readouterr().err


def test_an_evaluation_without_its_designs_stops_the_sweep(tmp_path: Path, capsys: Capture) -> None:
    place = f"hydra.sweep.dir={tmp_path / 'sweep'}"
    designs = f"designs={tmp_path / 'nothing.csv'}"
    assert evaluate(["-m", *TINY, "executor=serial", place, designs, "trials=1,2"]) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert "nothing.csv: not found; give a CSV file of designs" in line
    assert not (tmp_path / "sweep").exists()


@given(st.data())
def test_a_fault_is_named_by_the_overrides_that_cause_it(data: st.DataObject) -> None:
    axes = data.draw(st.lists(st.integers(2, 4), min_size=1, max_size=3))
    values = [[f"key{axis}={value}" for value in range(count)] for axis, count in enumerate(axes)]
    axis = data.draw(st.integers(0, len(axes) - 1))
    wrong = data.draw(st.sampled_from(values[axis]))
    jobs = [("common=1", *job) for job in product(*values)]
    refused = [RefusedJob(job, "key: must be another") for job in jobs if wrong in job]
    ready = [job for job in jobs if wrong not in job]
    count = len(jobs) // axes[axis]
    assert list(describe_faults(ready, refused)) == [
        f"{wrong} ({count} of {len(jobs)} jobs; no job was started): key: must be another"
    ]


SEEDS = "seed=3,12"


@pytest.mark.parametrize(
    "words",
    [
        pytest.param(("trials=1,2", SEEDS, "+treatment.name=mine"), marks=pytest.mark.slow),
        (SEEDS, "trials=${seed}"),
        ("failure=none,random", "seed=3,0", "hydra.sweep.subdir=s_${seed}"),
        ("optimizer.mutation_probability=0.30000000000000004,0.000001,1",),
        ("robot.mount.z_m=0.1,0.2", "trials=1,0", "failure=random", "failure.latest_s=60.0"),
    ],
)
def test_jobs_that_differ_in_numbers_are_as_each_is_alone(words: tuple[str, ...]) -> None:
    place = "hydra.sweep.dir=a"
    together = [job for job in Jobs([*words, place], True, None) if isinstance(job, Job)]
    assert len(together) == len(Jobs([*words, place], True, None))
    for job in together:
        (alone,) = Jobs([*job.overrides, place], True, None)
        assert isinstance(alone, Job)
        assert alone.config == job.config
        assert alone.config.values == job.config.values


def test_jobs_that_differ_in_their_search_share_robots_and_worlds(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    checked: list[Any] = []
    monkeypatch.setattr(search, "preflight", checked.append)
    monkeypatch.setattr("evoros.cli.sweep.create_run", lambda *_: 1 / 0)  # no job begins
    sweep(tmp_path / "sweep", "seed=range(9)", "trials=1,2", "course.time_limit_s=50,60")
    limits = [experiment.course.time_limit_s for experiment in checked]
    assert limits == [50, 60]


# ---- too few seeds


def test_a_sweep_with_too_few_seeds_says_so_and_what_to_type(
    tmp_path: Path, capsys: Capture
) -> None:
    options = ["optimizer.generations=1", "optimizer.population_size=2"]
    assert sweep(tmp_path / "few", *options, "seed=7,8", "trials=1,2") == DONE
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "treatments" in line]
    assert line.startswith("2 treatments with 2 seeds each: 'evoros analyze compare' ")
    needed = minimum_replicates(1)
    assert is_of(line, "evoros/cli/checking.py seed=range({ends})")
    typed = f"seed=range(7,{7 + needed})"
    assert line.endswith(f"for {needed} seeds per treatment, type '{typed}'")
    assert len(Jobs([typed], True, None)) == needed
    assert list(advise_seeds([set(range(7, 7 + needed))] * 2)) == []


@pytest.mark.slow
def test_evaluations_and_one_treatment_compare_nothing(tmp_path: Path, capsys: Capture) -> None:
    options = ["optimizer.generations=1", "optimizer.population_size=2"]
    assert sweep(tmp_path / "runs", *options, "seed=7,8") == DONE
    place = f"hydra.sweep.dir={tmp_path / 'scores'}"
    designs = f"designs={tmp_path / 'runs'}"
    assert evaluate(["-m", *TINY, "executor=serial", place, designs, "trials=1,2"]) == DONE
    assert "treatments" not in capsys.readouterr().err


def read_advice(counts: list[int], command: str) -> list[int]:
    """Return the numbers of seeds that are asked for so that a command may find something."""
    lines = advise_seeds([set(range(count)) for count in counts])
    typed = [re.findall(r"type 'seed=range\((\d+)\)'", x) for x in lines if f" {command}' " in x]
    return [int(number) for (number,) in typed]


@given(st.lists(st.integers(1, 9), min_size=2, max_size=5))
@settings(max_examples=30, deadline=None)
def test_the_advice_is_what_the_comparison_would_say(counts: list[int]) -> None:
    """Values as far apart as can be show a difference if and only if there is no advice."""
    import pandas as pd

    rows = [
        {"treatment": f"t{index}", "recorded": 100.0 * index + seed}
        for index, count in enumerate(counts)
        for seed in range(count)
    ]
    said = conclude(compare_treatments(pd.DataFrame(rows), ["recorded"]))
    advice = read_advice(counts, "compare")
    assert bool(advice) != any("is higher" in line for line in said)
    for needed in advice:
        assert not read_advice([needed] * len(counts), "compare")
        assert read_advice([needed - 1] * len(counts), "compare") or needed == 1


@given(st.lists(st.integers(1, 4), min_size=3, max_size=5))
@settings(max_examples=15, deadline=None)
def test_the_advice_is_what_the_factors_would_say(counts: list[int]) -> None:
    """A treatment with one run is refused, and others show an effect unless there is advice."""
    cells: dict[tuple[str, ...], Array] = {
        (f"t{i}",): np.full(count, 100.0 * i) + np.linspace(0.0, count - 1.0, count)
        for i, count in enumerate(counts)
    }
    advice = read_advice(counts, "factors")
    if min(counts) > 1:
        (test,) = list_tests("recorded", cells, ["treatment"])
        assert bool(advice) == (float(str(test["p_holm"])) >= LEVEL)
    assert advice or min(counts) > 1
    for needed in advice:
        assert not read_advice([needed] * len(counts), "factors")
        assert read_advice([needed - 1] * len(counts), "factors")


def test_runs_of_one_treatment_agree_in_all_but_what_figures_leave_out() -> None:
    def treatment(*words: str) -> str:
        (job,) = Jobs(words, False, None)
        assert isinstance(job, Job)
        return find_treatment(job.config)

    same = treatment()
    assert treatment("seed=5", "record=none", "figures=[fitness]", "executor=serial") == same
    others = [treatment(word) for word in ("trials=2", "failure=random", "+treatment.name=a")]
    assert len({same, *others}) == 4
