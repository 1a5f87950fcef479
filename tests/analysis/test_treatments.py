"""Treatments are told by factors and levels, or by names that the user gives."""

import argparse
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import yaml
from fixture_types import Capture, Folders, Log
from helpers import tiny, vary
from hypothesis import given
from hypothesis import strategies as st

from evoros.analysis.command import evoros_analyze
from evoros.analysis.drawing.style import choose_style
from evoros.analysis.products import make_product
from evoros.analysis.subcommands import Product
from evoros.analysis.tables.factors import find_factors, list_conditions
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.study import Study
from evoros.analysis.tables.treatments import (
    SINGLE,
    label_treatments,
    name_treatments,
    parse_conditions,
    read_treatments,
    select_rows,
)
from evoros.base.errors import InputError
from evoros.terminal.console import DONE, INPUT


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: Folders) -> Path:
    """Two settings of two levels."""
    folder = tmp_path_factory.mktemp("sweep")
    assert tiny(folder / "run", "optimizer.generations=1") == DONE
    for effect, size in product(("silence", "stuck"), (2, 3)):
        config = {"failure.effect._target_": effect, "optimizer.population_size": size}
        vary(folder / "run", folder / f"{effect}_{size}", config)
    shutil.rmtree(folder / "run")
    return folder


def analyze(*arguments: object) -> int:
    status: int = evoros_analyze(list(map(str, arguments)))
    return status


# Factors ------------------------------------------------------------------------------------

VALUES = st.fixed_dictionaries(
    {
        "seed": st.integers(0, 1),
        "trials": st.integers(1, 2),
        "failure._target_": st.sampled_from(["a.None", "a.Random"]),
        "failure.count": st.integers(1, 2),
        "failure.effect._target_": st.sampled_from(["f.Stuck", "f.Silence"]),
        "world.maze.sdf": st.sampled_from(["a", "b"]),
    },
    optional={"failure.late": st.booleans(), "world.yard.sdf": st.just("y")},
)
CHOICES = st.fixed_dictionaries(
    {},
    optional={
        "failure": st.sampled_from(["calm", "wild"]),
        "experiment": st.sampled_from(["short", "long"]),
    },
)
GIVEN = st.fixed_dictionaries(
    {}, optional={"name": st.sampled_from(["one", "two"]), "size": st.sampled_from([1, "x"])}
)


@given(st.lists(st.tuples(VALUES, CHOICES, GIVEN), min_size=1, max_size=7))
def test_levels_and_labels_are_equal_if_and_only_if_treatments_are(rows: list[Any]) -> None:
    values, choices, named = map(list, zip(*rows, strict=True))
    factors = find_factors(values, choices, named)
    names = [factor.name for factor in factors]
    assert len(set(names)) == len(names)
    assert all(len(set(factor.levels)) > 1 for factor in factors)
    labels = label_treatments(values, choices, named)
    conditions = list_conditions(values, named)
    for i, j in product(range(len(rows)), repeat=2):
        same = conditions[i] == conditions[j]
        assert (labels[i] == labels[j]) == same
        levels = [(f.levels[i], f.levels[j]) for f in factors]
        unnamed = list_conditions(values, [{**part, "name": ""} for part in named])
        assert all(a == b for a, b in levels) == (unnamed[i] == unnamed[j])


def test_a_sweep_over_two_settings_is_two_factors_whose_levels_are_in_every_label() -> None:
    grid = list(product(("none", "random"), (6, 12), (0, 1)))
    values = [
        {
            "seed": seed,
            "failure._target_": f"evoros.failure.{name}",
            **({"failure.count": 1} if name == "random" else {}),
            "optimizer.population_size": size,
        }
        for name, size, seed in grid
    ]
    choices = [{"failure": name} for name, _, _ in grid]
    result = {factor.name: factor.levels for factor in find_factors(values, choices)}
    assert result == {
        "failure": tuple(name for name, _, _ in grid),
        "population_size": tuple(str(size) for _, size, _ in grid),
    }
    labels = label_treatments(values, choices)
    assert labels == [f"failure {name}, population size {size}" for name, size, _ in grid]


def test_a_group_that_was_swept_is_the_factor_and_its_choices_are_the_levels() -> None:
    people = {"agents.alice._target_": "evoros.evolution.agent.Agent", "agents.alice.scored": False}
    values = [{"seed": 0, "agents": {}}, {"seed": 0, **people}]
    (factor,) = find_factors(values, [{"agents": "none"}, {"agents": "people"}])
    assert (factor.name, factor.levels) == ("agents", ("none", "people"))

    values = [{"confirmation": None}, {"confirmation.simulator._target_": "a.Physics"}]
    (factor,) = find_factors(values, [{"confirmation": "none"}, {"confirmation": "pybullet"}])
    assert (factor.name, factor.levels) == ("confirmation", ("none", "pybullet"))


def test_an_experiment_that_was_swept_is_the_factor_instead_of_all_that_it_sets() -> None:
    grid = list(product(("small", "large"), (0.1, 0.2)))
    sizes = {"small": (4, "a.Ga"), "large": (32, "a.Random")}
    values = [
        {
            "optimizer.population_size": sizes[name][0],
            "optimizer._target_": sizes[name][1],
            "noise": noise,
        }
        for name, noise in grid
    ]
    factors = find_factors(values, [{"experiment": name, "executor": name} for name, _ in grid])
    assert {factor.name: factor.levels for factor in factors} == {
        "experiment": tuple(name for name, _ in grid),
        "noise": tuple(str(noise) for _, noise in grid),
    }
    (factor,) = find_factors([{"x": 1}, {"x": 2}], [{"experiment": "small"}, {}])
    assert factor.name == "x"  # one of the runs has no experiment by which to call it


def test_a_value_that_follows_from_a_given_factor_is_no_factor() -> None:
    values = [{"a": i, "b": -i, "c": i % 2} for i in (0, 1, 2, 3)]
    named = [{"body": "light" if i < 2 else "heavy"} for i in (0, 1, 2, 3)]
    names = [factor.name for factor in find_factors(values, [], named)]
    assert names == ["body", "a", "b", "c"]  # a, b, c differ within a body
    named = [{"body": f"b{i}"} for i in (0, 1, 2, 3)]
    assert [factor.name for factor in find_factors(values, [], named)] == ["body"]


def test_a_key_that_others_refer_to_is_one_factor() -> None:
    values = [{"world.maze.course.time_limit_s": t, "course.time_limit_s": t} for t in (1, 2)]
    (factor,) = find_factors(values)
    assert factor.key == "course.time_limit_s"
    assert label_treatments(values) == ["time limit 1 s", "time limit 2 s"]


def test_a_name_that_two_treatments_share_is_followed_by_what_differs() -> None:
    values = [{"trials": 1}, {"trials": 2}, {"trials": 3}]
    named = [{"name": "mine"}, {"name": "mine"}, {"name": "other"}]
    assert label_treatments(values, [], named) == ["mine, trials 1", "mine, trials 2", "other"]
    assert label_treatments(values[:1] * 2, [], named[::2]) == ["mine", "other"]


# Conditions ---------------------------------------------------------------------------------


def test_conditions_choose_runs_by_every_factor_and_key(sweep: Path) -> None:
    whole = load_study([sweep])
    assert set(whole.factors) == {"effect", "population_size"}
    chosen = load_study([sweep], ["effect=stuck", "population size=2.0,3"])
    assert [record.name for record in chosen.records] == ["stuck_2", "stuck_3"]
    assert chosen.treatments == ("population size 2", "population size 3")
    assert len(load_study([sweep], ["generations=1"]).records) == 4  # no factor, but a key
    one = load_study([sweep], ["failure.effect=stuck", "optimizer.population_size=3"])
    assert one.treatments == (SINGLE,)


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ("colour=red", "their factors are effect, population_size"),
        ("effect=loud", "effect must be one of silence, stuck, not 'loud'"),
        ("effect", "must have the form FACTOR=LEVEL"),
        ("effect=", "must have the form FACTOR=LEVEL"),
    ],
)
def test_a_condition_on_what_is_not_there_is_one_line_that_says_what_is(
    where: str, said: str, sweep: Path, tmp_path: Path, capsys: Capture
) -> None:
    assert analyze("fitness", sweep, "--where", where, "--output", tmp_path / "out") == INPUT
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert said in err
    assert not (tmp_path / "out").exists()


def test_conditions_that_no_run_meets_are_one_line(sweep: Path) -> None:
    records = load_study([sweep]).records
    apart = [records[0], records[3]]  # silence with 2, stuck with 3
    none = parse_conditions(["effect=silence", "population_size=3"])
    assert not any(select_rows(apart, none, ""))
    folders = [record.path for record in apart]
    with pytest.raises(InputError, match="none of 2 runs meets all conditions"):
        load_study(folders, ["effect=silence", "population_size=3"])


# Names --------------------------------------------------------------------------------------


def test_a_name_and_factors_of_a_configuration_are_recorded_and_shown(
    sweep: Path, tmp_path: Path
) -> None:
    more = ["treatment.name=thin", "+treatment.body=light", "optimizer.generations=1"]
    assert tiny(tmp_path / "named", *more) == DONE
    recorded = yaml.safe_load((tmp_path / "named" / "config.yaml").read_text())
    assert recorded["treatment"] == {"name": "thin", "body": "light"}
    study = load_study([tmp_path, sweep])
    labels = {record.name: record.treatment for record in study.records}
    assert labels["named"] == "thin"
    assert len(set(labels.values())) == 5
    assert study.find("named").levels["body"] == "light"
    assert study.find("stuck_2").levels["body"] == ""


@pytest.mark.parametrize(
    "wrong", ["treatment.name=3", "treatment.name=' '", "+treatment.seed=1", "+treatment.size=[1]"]
)
def test_a_wrong_name_or_factor_is_one_line_before_the_run(
    wrong: str, tmp_path: Path, capsys: Capture
) -> None:
    assert tiny(tmp_path / "run", wrong) == INPUT
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "treatment" in err
    assert not (tmp_path / "run").exists()


ENTRIES: list[dict[str, Any]] = [
    {"name": "few", "where": {"population_size": 2}, "effort": "low"},
    {"name": "many", "where": {"population_size": [3, 4]}, "effort": "high"},
]


def write(path: Path, entries: object) -> Path:
    path.write_text(yaml.safe_dump(entries))
    return path


def test_a_file_names_the_treatments_of_folders(sweep: Path, tmp_path: Path) -> None:
    file = write(tmp_path / "names.yaml", ENTRIES)
    study = load_study([sweep], (), file)
    assert study.treatments == ("few, silence", "many, silence", "few, stuck", "many, stuck")
    assert study.factors == ("effort", "effect")
    chosen = load_study([sweep], ["effort=low"], file)
    assert [record.name for record in chosen.records] == ["silence_2", "stuck_2"]
    by_folder = [{"name": "s", "folders": "stuck*"}, {"name": "t", "folders": ["silen*"]}]
    names = load_study([sweep], (), write(file, by_folder)).records
    assert [record.given["name"] for record in names] == ["t", "t", "s", "s"]


@pytest.mark.parametrize("condition", ["effort=low", "population_size=2"])
def test_runs_that_a_condition_excludes_need_no_entry(
    condition: str, sweep: Path, tmp_path: Path
) -> None:
    study = load_study([sweep], [condition], write(tmp_path / "names.yaml", ENTRIES[:1]))
    assert [record.name for record in study.records] == ["silence_2", "stuck_2"]
    assert {record.given["name"] for record in study.records} == {"few"}


def test_an_entry_that_fits_no_run_is_told(sweep: Path, tmp_path: Path, caplog: Log) -> None:
    idle = {"name": "idle", "where": {"effect": "stucky"}}
    study = load_study([sweep], (), write(tmp_path / "names.yaml", [*ENTRIES, idle]))
    assert len(study.records) == 4
    (message,) = caplog.messages
    assert "names.yaml: 'idle' matches no run" in message


WRONG: list[tuple[object, str]] = [
    (ENTRIES[:1], "matches no entry; add an entry"),
    ([*ENTRIES, {"name": "all", "folders": "*"}], "matches both 'few' and 'all'"),
    ([*ENTRIES, ENTRIES[0]], "is used 2 times"),
    ([{"name": "x"}], "entry 1: needs the keys name, and where"),
    ([{"where": {"effect": "stuck"}}], "name must be a string"),
    ([{**ENTRIES[0], "seed": 3}], "'seed' must be"),
    ([{"name": "x", "where": {"colour": 1}}], "their factors are effect, population_size"),
    ([{"name": "x", "where": ["a"]}], "where must be a mapping"),
    ([{"name": "x", "folders": [1]}], "folders must be a list"),
    ({"few": 1}, "must be a list of treatments"),
    ([], "must be a list of treatments"),
]


@pytest.mark.parametrize(("entries", "said"), WRONG)
def test_a_file_that_does_not_fit_is_one_line(
    entries: object, said: str, sweep: Path, tmp_path: Path, capsys: Capture
) -> None:
    file = write(tmp_path / "names.yaml", entries)
    output = tmp_path / "out"
    assert analyze("fitness", sweep, "--treatments", file, "--output", output) == INPUT
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert said in err
    assert not output.exists()
    for content in ("a: [", None):
        if content is None:
            file.unlink()
        else:
            file.write_text(content)
        with pytest.raises(InputError, match=r"not valid YAML|cannot be read"):
            read_treatments(file)


def test_a_named_record_keeps_all_else(sweep: Path, tmp_path: Path) -> None:
    records: Sequence[Record] = load_study([sweep]).records
    entries = read_treatments(write(tmp_path / "n.yaml", ENTRIES))
    named, problems = name_treatments(records, entries, tmp_path)
    assert not problems
    for before, after in zip(records, named, strict=True):
        assert replace(after, given=before.given).values == before.values
        assert after.name == before.name


# Tables -------------------------------------------------------------------------------------


@dataclass
class Tables:
    """A subcommand that makes these tables."""

    tables: dict[str, pd.DataFrame]
    HELP: str = field(default="", init=False)
    NEEDS: str = field(default="", init=False)
    FILES: Sequence[str] = field(default=(), init=False)

    def make_product(self, study: Study, options: argparse.Namespace) -> Product:
        return Product(self.tables["main"], tables=self.tables)


def test_every_table_has_the_levels_of_its_rows(sweep: Path) -> None:
    study = load_study([sweep])
    labels = list(study.treatments)
    tables = {
        "main": pd.DataFrame({"run": [r.name for r in study.records], "treatment": labels}),
        "pairs": pd.DataFrame({"measure": "m", "a": labels, "b": labels[::-1]}),
        "runs": pd.DataFrame({"run": [r.name for r in study.records], "effect": 1.0}),
        "other": pd.DataFrame({"x": [1]}),
        "all": pd.DataFrame({"treatment": ["all", *labels], "value": 0.0}),
    }
    made = make_product(Tables(tables), study, argparse.Namespace())
    levels = pd.DataFrame([dict(record.levels) for record in study.records])
    assert made.table is not None
    assert list(made.table.columns) == ["run", "treatment", "effect", "population_size"]
    assert made.table[["effect", "population_size"]].equals(levels)
    pairs = made.tables["pairs"]
    assert list(pairs["effect_b"]) == list(levels["effect"])[::-1]
    assert list(pairs["population_size_a"]) == list(levels["population_size"])
    assert list(made.tables["runs"]["factor_effect"]) == list(levels["effect"])
    assert made.tables["other"].equals(tables["other"])
    assert list(made.tables["all"]["effect"]) == ["", *levels["effect"]]
    assert list(tables["main"].columns) == ["run", "treatment"]  # not changed


def test_a_tab_in_the_file_is_named_by_its_line(tmp_path: Path) -> None:
    (tmp_path / "names.yaml").write_text("- name: a\n\twhere: {seed: 1}\n")
    with pytest.raises(InputError, match=r"names\.yaml: not valid YAML \(line 2: "):
        read_treatments(tmp_path / "names.yaml")


def test_a_key_of_a_style_that_matplotlib_does_not_know_is_named(tmp_path: Path) -> None:
    (tmp_path / "own.mplstyle").write_text("font.size: 7 # pt\n\n# a comment\nfont.sise: 8\n")
    with (
        pytest.raises(
            InputError, match=r"--style .*own\.mplstyle: matplotlib has no key 'font\.sise'"
        ),
        choose_style(str(tmp_path / "own.mplstyle")),
    ):
        pass
