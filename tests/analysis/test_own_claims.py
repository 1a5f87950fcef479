"""Claims of one's own are judged by the rules of the paper's, and wrong files are one line."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from fixture_types import Capture, Folders, Patch
from helpers import tiny, vary

from evoros.analysis.command import evoros_analyze
from evoros.analysis.figures import own_claims
from evoros.analysis.figures.own_claims import read_claims
from evoros.analysis.products import make_product
from evoros.analysis.statistics.finding import NOT_SUPPORTED, SUPPORTED, UNKNOWN, Finding
from evoros.analysis.statistics.small_samples import mean_interval
from evoros.analysis.subcommands import import_subcommand, parse
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.study import Study
from evoros.terminal.console import DONE, INPUT

NEAR = (0.05, 15.0)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: Folders) -> Path:
    """Seven runs each of two population sizes, whose recorded fitness differs by two."""
    folder = tmp_path_factory.mktemp("sweep")
    assert tiny(folder / "2_0", "optimizer.generations=1", "optimizer.population_size=2") == DONE
    for size in (2, 3):
        for seed in range(1, 8):
            config = {"optimizer.population_size": size, "seed": seed}
            status = {"best_fitness": 10 + 2 * (size == 3) + 0.1 * seed}
            vary(folder / "2_0", folder / f"{size}_{seed}", config, status)
    return folder


@pytest.fixture(scope="module")
def study(sweep: Path) -> Study:
    finding: Study = load_study(
        [sweep / f"{size}_{seed}" for size in (2, 3) for seed in range(1, 8)]
    )
    return finding


def write(path: Path, *entries: object) -> Path:
    path.write_text(yaml.safe_dump(list(entries)))
    return path


def claim(**more: Any) -> dict[str, Any]:
    return {"claim": "It is so", "measure": "recorded", "comparison": "above", **more}


def judge(
    study: Study, path: Path, monkeypatch: Patch, random: float = np.nan, **entry: Any
) -> Finding:
    """Judge a claim; the random designs of all runs have this value."""
    real = own_claims.measure_runs

    def measure(*given: Any) -> pd.DataFrame:
        table: pd.DataFrame = real(*given).assign(random=random)
        return table

    monkeypatch.setattr(own_claims, "measure_runs", measure)
    (part,) = read_claims(write(path / "claims.yaml", claim(**entry)))
    finding: Finding = own_claims.judge_own(part, study, NEAR)
    return finding


TWO, THREE = {"population_size": 2}, {"population_size": 3}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("entry", "verdict"),
    [
        ({"threshold": 10, "treatments": TWO}, SUPPORTED),
        ({"threshold": 11, "treatments": TWO}, NOT_SUPPORTED),
        ({"threshold": 10.4, "treatments": TWO}, UNKNOWN),
        ({"comparison": "below", "threshold": 11, "treatments": TWO}, SUPPORTED),
        ({"comparison": "below", "threshold": 10, "treatments": TWO}, NOT_SUPPORTED),
        ({"comparison": "within", "threshold": [10, 11], "treatments": TWO}, SUPPORTED),
        ({"comparison": "within", "threshold": [12, 13], "treatments": TWO}, NOT_SUPPORTED),
        ({"treatments": THREE, "against": TWO}, SUPPORTED),
        ({"treatments": TWO, "against": THREE}, NOT_SUPPORTED),
        ({"treatments": THREE, "against": TWO, "threshold": 3}, NOT_SUPPORTED),
        ({"treatments": "population size 3", "threshold": 12}, SUPPORTED),
    ],
)
def test_the_interval_decides(
    entry: dict[str, Any], verdict: str, study: Study, tmp_path: Path, monkeypatch: Patch
) -> None:
    finding = judge(study, tmp_path, monkeypatch, **entry)
    assert (finding.verdict, finding.n) == (verdict, 7)
    if entry.get("treatments") is TWO and "against" not in entry:
        values = [10 + 0.1 * seed for seed in range(1, 8)]
        interval = mean_interval(values)
        assert (finding.value, finding.low, finding.high) == pytest.approx(
            (interval.value, interval.low, interval.high)
        )


@pytest.mark.parametrize(
    ("random", "verdict"), [(5.0, SUPPORTED), (10.4, UNKNOWN), (12.0, UNKNOWN)]
)
def test_what_random_designs_meet_as_well_is_no_support(
    random: float, verdict: str, study: Study, tmp_path: Path, monkeypatch: Patch
) -> None:
    finding = judge(study, tmp_path, monkeypatch, random, threshold=4, treatments=TWO)
    assert (finding.verdict, finding.random) == (verdict, random)
    assert ("not distinguishable from random designs" in finding.why) == (verdict == UNKNOWN)


def test_few_replicates_give_no_verdict(study: Study, tmp_path: Path, monkeypatch: Patch) -> None:
    some = study.keep(study.records[:5])
    finding = judge(some, tmp_path, monkeypatch, threshold=1)
    assert finding.verdict == UNKNOWN
    assert "5 replicates" in finding.why
    one = judge(study.keep(study.records[:1]), tmp_path, monkeypatch, threshold=1)
    assert one.why.startswith("needs at least two finished runs")


@pytest.mark.slow
def test_every_named_measure_can_be_read(study: Study) -> None:
    known = {}
    for measure in (*own_claims.NAMED, "fitness"):
        table = own_claims.measure_runs(measure, study, NEAR, "here")
        assert list(table.index) == [record.name for record in study.records]
        known[measure] = table.notna().any()
    assert all(column["value"] for name, column in known.items() if "validated" not in name)
    assert all(known[name]["random"] for name in ("recorded", "completed", "sensors", "ahead"))


@pytest.mark.slow
@pytest.mark.parametrize("figure", ["claims", "strategies"])
def test_random_designs_without_sensors_leave_claims_to_be_judged(sweep: Path, figure: str) -> None:
    study = load_study([sweep / f"2_{seed}" for seed in range(1, 8)])
    for record in study.records:
        table = record.run.generations.copy()
        mounts = [name for name in table if str(name).startswith("sensor")]
        table.loc[table.generation == 0, mounts] = np.nan
        vars(record.run)["generations"] = table
    assert study.initial.empty
    product = make_product(import_subcommand(figure), study, parse([figure, "."]))
    assert product.table is not None
    assert len(product.table) > 0
    assert "nan" not in " ".join(product.messages)


def test_the_command_judges_the_claims_of_a_file(sweep: Path, tmp_path: Path) -> None:
    file = write(
        tmp_path / "claims.yaml",
        claim(threshold=5, treatments=TWO),
        claim(claim="Designs have sensors", measure="sensors", comparison="above", threshold=0),
    )
    given = ["claims", str(sweep), "--claims", str(file), "--output", str(tmp_path / "out")]
    assert evoros_analyze([*given, "--format", "svg"]) == DONE
    table = pd.read_csv(tmp_path / "out" / "claims.csv")
    assert list(table.claim) == ["It is so", "Designs have sensors"]
    assert (tmp_path / "out" / "claims.svg").exists()


WRONG: list[tuple[object, str]] = [
    ({}, "entry 1: claim must be a string"),
    ("words", "entry 1: not a mapping"),
    (claim(), "threshold must be a number, not None"),
    (claim(threshold="high"), "threshold must be a number"),
    (claim(threshold=1, colour="red"), "unknown key 'colour'"),
    (claim(threshold=1, comparison="over"), "comparison must be one of above, below, within"),
    (claim(threshold=1, comparison="within"), "threshold must be two numbers"),
    (claim(threshold=[2, 1], comparison="within"), "threshold must be two numbers"),
    (claim(threshold=1, measure="beauty"), "measure must be one of recorded, validated"),
    (claim(threshold=1, treatments={"colour": 1}), "their factors are population_size"),
    (claim(threshold=1, treatments={"population_size": 9}), "must be one of 2, 3, not '9'"),
    (claim(threshold=1, treatments="mine"), "treatment 'mine' not found"),
    (claim(threshold=1, treatments=7), "must map factors to levels"),
]


@pytest.mark.parametrize(("entry", "said"), WRONG)
def test_a_wrong_claim_is_one_line(
    entry: object, said: str, sweep: Path, tmp_path: Path, capsys: Capture
) -> None:
    file = write(tmp_path / "claims.yaml", entry)
    pair = [str(sweep / name) for name in ("2_1", "3_1")]
    given = ["claims", *pair, "--claims", str(file), "--output", str(tmp_path / "out")]
    capsys.readouterr()
    assert evoros_analyze(given) == INPUT
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert said in err
    assert not (tmp_path / "out").exists()


def test_a_file_that_cannot_be_read_is_one_line(
    sweep: Path, tmp_path: Path, capsys: Capture
) -> None:
    for content in ("a: [", "a: 1", None):
        file = tmp_path / "claims.yaml"
        if content is None:
            file.unlink()
        else:
            file.write_text(content)
        assert evoros_analyze(["claims", str(sweep / "2_1"), "--claims", str(file)]) == INPUT
        assert capsys.readouterr().err.count("\n") == 1
