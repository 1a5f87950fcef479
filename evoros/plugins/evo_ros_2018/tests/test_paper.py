"""The figures of the 2018 paper from a case study, and what is said of those that are missing."""

from pathlib import Path

import pandas as pd
import pytest
from fixture_types import Capture, Folders
from helpers import tiny

from evoros.analysis.command import evoros_analyze
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.tracks import load_champion_worlds
from evoros.plugins.evo_ros_2018.course import list_waypoints
from evoros.terminal.console import DONE

ALL = {
    5: "regions",
    6: "course",
    7: "panel",
    8: "overlay",
    9: "fitness",
    10: "failure",
    11: "panel",
}


@pytest.fixture(scope="module")
def study(tmp_path_factory: Folders) -> Path:
    folder = tmp_path_factory.mktemp("paper")
    calm = ("failure=none", "~failure.earliest_s", "~failure.latest_s")
    for name, failure in (("none", calm), ("spatial", ("failure=spatial",))):
        assert tiny(folder / name, *failure, "optimizer.generations=1") == DONE
    return folder


def draw(folder: Path, output: Path, capsys: Capture) -> tuple[set[int], str]:
    """The numbers of the figures that are there, and what was said."""
    given = ["paper", str(folder), "--output", str(output), "--panel-letters", "A"]
    assert evoros_analyze(given) == DONE
    listed = pd.read_csv(output / "paper.csv")
    for figure_number, file in zip(listed["figure"], listed["file"], strict=True):
        assert file == f"figure_{figure_number:02d}_{ALL[figure_number]}.pdf"
        assert (output / file).read_bytes().startswith(b"%PDF")
        assert len(pd.read_csv((output / file).with_suffix(".csv")))
    return set(listed["figure"]), capsys.readouterr().out


@pytest.mark.slow
def test_a_case_study_gives_all_figures_under_their_numbers(
    study: Path, tmp_path: Path, capsys: Capture
) -> None:
    result, said = draw(study, tmp_path, capsys)
    assert result == set(ALL)
    assert "Fig." not in said


@pytest.mark.slow
@pytest.mark.parametrize(("treatment", "lacking"), [("none", {10, 11}), ("spatial", {5, 7, 8, 9})])
def test_each_missing_figure_is_one_line(
    treatment: str, lacking: set[int], study: Path, tmp_path: Path, capsys: Capture
) -> None:
    result, said = draw(study / treatment, tmp_path, capsys)
    assert result == set(ALL) - lacking
    lines = [line for line in said.splitlines() if line.startswith("Fig. ")]
    assert [int(line.split()[1]) for line in lines] == sorted(lacking)
    assert all("add runs with failure=" in line for line in lines)


def test_the_courses_are_those_of_the_worlds(study: Path) -> None:
    (record,) = load_study([study / "none"]).records
    worlds = load_champion_worlds(record.run, record.context)
    table = list_waypoints(worlds)
    for name, course in record.context.courses.items():
        part = table[table["world"] == name]
        places = [tuple(course.home[:2]), *map(tuple, course.waypoints)]
        assert [tuple(place) for place in part[["x_m", "y_m"]].to_numpy()] == places
        assert part["number"].tolist() == list(range(len(places)))
