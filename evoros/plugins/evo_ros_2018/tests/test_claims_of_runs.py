"""The claims of whole runs and the figures of the 2018 paper: rows, sources and gaps."""

import itertools
import json
import shutil
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from fixture_types import Capture, Folders
from helpers import TINY, tiny
from matplotlib.backends.backend_agg import FigureCanvasAgg

from evoros.analysis.command import evoros_analyze
from evoros.analysis.drawing.style import PAGE_IN
from evoros.analysis.figures.claims import draw_claims
from evoros.analysis.statistics.finding import NOT_SUPPORTED, SUPPORTED, UNKNOWN
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.tracks import load_champion_worlds
from evoros.analysis.tables.validated import classify_failure, list_missions
from evoros.cli.command import evaluate
from evoros.plugins.evo_ros_2018.claims_designs import read_diversity
from evoros.plugins.evo_ros_2018.course import list_waypoints
from evoros.storage.figure_context import Ring
from evoros.terminal.console import DONE, INPUT

CALM = ("failure=none", "~failure.earliest_s", "~failure.latest_s")
FREE = ("design=free_sonars",)
FAILING = ("failure=random", "failure.earliest_s=0.1", "failure.latest_s=0.2")


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Mirrored runs, one under random failure, a free one, and an evaluation of champions."""
    folder = tmp_path_factory.mktemp("claims")
    more = ("optimizer.validation_trials=1", "optimizer.generations=2")
    for name, overrides in {"x0": CALM, "x1": FAILING, "free": (*CALM, *FREE)}.items():
        assert tiny(folder / "runs" / name, *overrides, *more) == DONE
    assert tiny(folder / "runs" / "x2", *FAILING, *more, "seed=7") == DONE
    given = "designs=[" + ",".join(str(folder / "runs" / name) for name in ("x0", "x1", "x2")) + "]"
    arguments = [*TINY, *FAILING, "executor=serial", "trials=3", given]
    assert evaluate([*arguments, f"hydra.run.dir={folder / 'again'}"]) == DONE
    return folder


def analyze(output: Path, *folders: Path) -> None:
    given = ["claims", *map(str, folders), "--output", str(output), "--format", "svg"]
    assert evoros_analyze(given) == DONE


def rows(output: Path) -> pd.DataFrame:
    return pd.read_csv(output / "claims.csv")


@pytest.fixture(scope="module")
def drawn(sweep: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("drawn")
    analyze(output, sweep / "runs", sweep / "again")
    return output


def test_every_claim_has_a_row_and_what_is_missing_is_said(drawn: Path) -> None:
    table = rows(drawn)
    assert table.claim.nunique() == 8
    assert table.why.notna().all()
    assert set(table.verdict) <= {SUPPORTED, NOT_SUPPORTED, UNKNOWN}
    missing = table[table.why.str.startswith("needs")]
    assert missing.value.isna().all()
    assert (missing.verdict == UNKNOWN).all()
    assert "needs mirrored runs with failure=spatial" in set(missing.why)


def test_kinds_come_from_the_configuration_and_not_from_names(sweep: Path) -> None:
    study = load_study([sweep / "runs"])
    assert {record.name: classify_failure(record) for record in study.records} == {
        "x0": "none",
        "x1": "random",
        "x2": "random",
        "free": "none",
    }
    x1 = study.find("x1")
    hit = replace(x1, context=replace(x1.context, rings=(Ring(0.1, 1.0),)))
    assert classify_failure(hit) == "spatial"


def test_missions_are_those_of_champions_on_fresh_draws(sweep: Path, tmp_path: Path) -> None:
    """Those that two evaluations have in common count once."""
    shutil.copytree(sweep / "again", tmp_path / "same_draws")
    study = load_study([sweep / "runs", sweep / "again", tmp_path])
    assert len(study.evaluations) == 2
    run = study.find("x2").run
    other = run.missions[run.missions.purpose == "validation"]
    other = other.assign(design=-1, draws=other.draws + "/more")  # of a design that was best before
    run.__dict__["missions"] = pd.concat([run.missions, other], ignore_index=True)
    table = list_missions(study)
    for name in ("x1", "x2"):
        mine = table[table.run == name]
        counts = mine.groupby("source").size().to_dict()
        worlds = study.find(name).run.missions.world.nunique()
        assert counts == {"validated in the run": worlds, "evaluated in bicycle": 3 * worlds}
        assert mine.failed.all()
    assert set(table[table.run == "x0"].source) == {"validated in the run"}  # flown without failure
    assert not table[table.run == "x0"].failed.any()


def test_the_diversity_of_a_population_counts_its_copies(sweep: Path) -> None:
    record = load_study([sweep / "runs" / "x0"]).records[0]
    table = record.run.generations
    row = read_diversity(record).iloc[0]
    assert 0 < row["first"] <= 1
    assert 0 <= row["last"] <= 1
    first = table[table.generation == 0].drop_duplicates("id").iloc[:2]
    again = first.assign(generation=99, survived=1)
    copies = pd.concat([table, again, again.iloc[:1]], ignore_index=True)  # the first stands twice
    record.run.__dict__["generations"] = copies
    two = pd.concat([table, again], ignore_index=True)
    kept = read_diversity(record).iloc[0]["last"]
    record.run.__dict__["generations"] = two
    assert kept == pytest.approx(
        2 / 3 * read_diversity(record).iloc[0]["last"]
    )  # 2 of 3 pairs differ


@pytest.mark.slow
def test_the_order_of_folders_changes_no_number(sweep: Path, drawn: Path, tmp_path: Path) -> None:
    folders = [sweep / "again", *(sweep / "runs" / name for name in ("x2", "free", "x1", "x0"))]
    analyze(tmp_path, *folders)
    pd.testing.assert_frame_equal(rows(tmp_path), rows(drawn), rtol=1e-9)


def test_unmirrored_runs_alone_have_a_row_for_each_claim(sweep: Path, tmp_path: Path) -> None:
    analyze(tmp_path, sweep / "runs" / "free")
    assert rows(tmp_path).claim.nunique() == 8
    assert (rows(tmp_path).verdict == UNKNOWN).all()


@pytest.mark.slow
def test_unfinished_and_damaged_runs_are_left_out_in_one_line(
    sweep: Path, drawn: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(sweep / "runs", tmp_path / "runs")
    for name in ("x3", "x4"):
        shutil.copytree(sweep / "runs" / "x0", tmp_path / "runs" / name)
    status = tmp_path / "runs" / "x3" / "status.json"
    status.write_text(json.dumps({**json.loads(status.read_text()), "state": "stopped"}))
    next((tmp_path / "runs" / "x4" / "champion").glob("trajectory_*.csv")).write_text("time_s\n1\n")
    output = tmp_path / "out"
    analyze(output, tmp_path / "runs", sweep / "again")
    lines = capsys.readouterr().err.splitlines()
    assert [("x3" in line, "x4" in line) for line in lines] == [(True, False), (False, True)]
    assert (output / "claims.csv").read_bytes() == (drawn / "claims.csv").read_bytes()
    alone = [str(tmp_path / "runs" / "x3")]
    for name in ("claims", "strategies"):
        assert evoros_analyze([name, *alone, "--output", str(tmp_path / "none")]) == INPUT
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--near-m=-1", "--near-deg=nan", "--near-m=inf"])
def test_thresholds_that_say_nothing_are_refused(
    option: str, sweep: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["strategies", str(sweep), option, "--output", str(tmp_path / "out")]
    assert evoros_analyze(arguments) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert option.partition("=")[0] in line


def test_finished_runs_are_kept_as_they_are(sweep: Path) -> None:
    study = load_study([sweep])
    kept = study.select_finished()
    assert kept.records == study.records
    assert kept.evaluations == study.evaluations


@pytest.mark.parametrize("width", [PAGE_IN / 2, PAGE_IN])
def test_nothing_in_the_table_overlaps_or_leaves_the_page(drawn: Path, width: float) -> None:
    figure = draw_claims(rows(drawn).fillna({"unit": ""}), width)
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    (axes,) = figure.axes
    boxes = [text.get_window_extent(renderer) for text in axes.texts]
    page = figure.bbox
    for box in boxes:
        assert page.x0 <= box.x0 <= box.x1 <= page.x1
        assert page.y0 <= box.y0 <= box.y1 <= page.y1
    for one, other in itertools.combinations(boxes, 2):
        across = min(one.x1, other.x1) - max(one.x0, other.x0)
        along = min(one.y1, other.y1) - max(one.y0, other.y0)
        assert across <= 0 or along <= 2, "lines may touch, not overlap"
    assert all(float(text.get_fontsize()) >= 6.5 for text in axes.texts)


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
