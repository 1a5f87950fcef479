"""Every subcommand of evoros analyze: on folders whole and not, and on runs that go on."""

import json
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest
from documents import columns, figure_pages
from fixture_types import Capture, Folders, Patch
from helpers import TINY, copied, cut, everything, finished_run, reseal, tiny, vary

from evoros import InputError
from evoros.analysis import analyze, command, load_study, save
from evoros.analysis.command import evoros_analyze
from evoros.analysis.figures import overlay
from evoros.analysis.subcommands import EXPORTS, SUBCOMMANDS, import_subcommand, parse, to_csv
from evoros.analysis.tables.champions import read_champion
from evoros.analysis.tables.designs import read_best
from evoros.cli.command import evaluate
from evoros.files.plugins import find_plugins
from evoros.terminal.console import DONE, INPUT

SHOWN = (
    "optimizer.generations=2",
    "+measure@descriptors.front=front_coverage",
    "+measure@descriptors.side=side_coverage",
    "+measure@objectives.fitness=fitness",
    "+measure@objectives.robustness=least_coverage",
)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: Folders) -> Path:
    """Finished runs of two treatments, an unfinished one, an empty folder, two evaluations."""
    folder = tmp_path_factory.mktemp("mixed")
    for failure in ("random", "spatial"):
        assert tiny(folder / failure, f"failure={failure}", *SHOWN) == DONE
        arguments = [*TINY, "executor=serial", f"designs={folder / 'random'}", f"failure={failure}"]
        assert evaluate([*arguments, "trials=2", f"hydra.run.dir={folder}/again_{failure}"]) == DONE
    shutil.copytree(folder / "random", folder / "unfinished")
    shutil.rmtree(folder / "unfinished" / "champion")
    status = folder / "unfinished" / "status.json"
    status.write_text(status.read_text().replace('"finished"', '"stopped"'))
    (folder / "empty").mkdir()
    return folder


def sections() -> dict[str, str]:
    parts = re.split(r"^## (\w+)$", figure_pages(), flags=re.M)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_every_subcommand_has_a_section() -> None:
    assert set(SUBCOMMANDS) <= set(sections())


def documented(subcommand: str, heading: str, result: list[str]) -> list[str]:
    """The columns of a file; some are there only in some runs, or in place of another."""
    names: list[str] = []
    for first, meaning in columns(sections()[subcommand], heading):
        instead = re.match(r"replaces `(\w+)`", meaning)
        if meaning.startswith("only with "):
            names += [name for name in re.findall(r"\w+", first) if name in result]
        elif instead is None:
            names += re.findall(r"\w+", first)
        elif first in result:
            names[names.index(instead[1])] = first
    return names


def is_announced(subcommand: str, name: str) -> bool:
    """Whether a file is the picture, or one that the subcommand says it writes."""
    announced = [f"{subcommand}.FORMAT", *import_subcommand(subcommand).FILES]
    patterns = (re.sub("[A-Z]+", ".+", file.rstrip("/")) for file in announced)
    return any(re.fullmatch(pattern, name) for pattern in patterns)


REFUSED = {
    **{
        "factors": "only one finished run; at least two are needed",
        "power": "replicates",
        "regression": "two evaluations",
        "controls": "resume RUN controls=all",
    },
    "requirements": "evaluation with requirements",
}
"""The subcommands that need what is not here, such as replicates."""
if "evo_ros_2018" not in find_plugins():
    REFUSED["claims"] = "write a claims file"
STRICT = sorted(SUBCOMMANDS.keys() & {"compare", "claims", "deploy"} - REFUSED.keys())
"""Statistics and exports that find here what they need."""
FACTOR = ("failure", "failure_a", "failure_b")
"""The columns of what the runs differ in; which tables have them is another test's."""
SHORT = {"video": ("--to", "3")}
"""Arguments with which a subcommand shows less."""


SLOW = {"report"}
"""Other tests have reports of several runs and of what is left out."""


@pytest.mark.parametrize(
    "subcommand",
    [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in SUBCOMMANDS],
)
def test_what_is_whole_is_used_and_what_is_not_is_said(
    subcommand: str, mixed: Path, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    """And the columns of its tables are those of the document, in order; nothing is drawn."""
    if subcommand != "report":
        for module in (command, import_subcommand(subcommand)):  # paper has several figures
            monkeypatch.setattr(module, "render", lambda *_, **__: b"", raising=False)
    before = everything(mixed)
    given = [subcommand, str(mixed), "--output", str(tmp_path), *SHORT.get(subcommand, ())]
    status = evoros_analyze(given)
    said, err = capsys.readouterr()
    assert everything(mixed) == before
    if subcommand in REFUSED:
        assert status == INPUT
        assert REFUSED[subcommand] in err.splitlines()[-1]
        return
    assert status == DONE
    files = sorted(tmp_path.iterdir())
    assert [str(file) for file in files] == sorted(said.splitlines()[-len(files) :])
    assert any(file.stem == subcommand or subcommand in EXPORTS for file in files)
    assert len(set(err.splitlines())) == len(err.splitlines())  # each is said once
    assert "Traceback" not in err
    assert [file.name for file in files if not is_announced(subcommand, file.name)] == []
    for file in files:
        if file.suffix == ".csv" and not file.stem.startswith("figure_"):  # of another subcommand
            title = f"{file.name}`, several runs" if subcommand == "fitness" else file.name
            names = [name for name in pd.read_csv(file).columns if name not in FACTOR]
            assert names == documented(subcommand, title, names)


@pytest.mark.parametrize("subcommand", SUBCOMMANDS)
def test_an_unfinished_run_alone_is_one_line(
    subcommand: str, mixed: Path, tmp_path: Path, capsys: Capture
) -> None:
    given = [subcommand, str(mixed / "unfinished"), "--output", str(tmp_path / "out")]
    status = evoros_analyze(given)
    err = capsys.readouterr().err
    assert "Traceback" not in err
    assert status in (DONE, INPUT)
    if status == INPUT:
        assert 1 <= err.count("\n") <= 2
        assert not (tmp_path / "out").exists()


def test_help_lists_every_subcommand_as_it_describes_itself(capsys: Capture) -> None:
    assert evoros_analyze(["--help"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for name in SUBCOMMANDS:
        assert f"{name} {' '.join(import_subcommand(name).HELP.split())}" in shown


def test_in_python_the_figures_have_the_tables_of_the_command(mixed: Path, tmp_path: Path) -> None:
    study = load_study([str(mixed)], ["failure=random,spatial"])
    product = analyze(study, "compare", without_tables=True)
    given = ["compare", str(mixed), "--output", str(tmp_path), "--without-tables"]
    assert evoros_analyze([*given, "--format", "svg"]) == DONE
    assert product.table is not None
    assert product.figure is not None
    assert to_csv(product.table) == (tmp_path / "compare.csv").read_bytes()
    save(product.figure, tmp_path / "again.svg")
    assert (tmp_path / "again.svg").read_bytes() == (tmp_path / "compare.svg").read_bytes()


def test_in_python_a_wrong_name_is_refused(mixed: Path) -> None:
    study = load_study([mixed])
    with pytest.raises(InputError, match=r"^figure: must be one of overlay, .*, not 'none'; "):
        analyze(study, "none")
    with pytest.raises(InputError, match=r"^overlay: no option 'output'; choose from .*\bcut\b"):
        analyze(study, "overlay", output="elsewhere")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finished_run(tmp_path_factory.mktemp("unfinished") / "run", "record=all")


def interrupt(run: Path, to: Path, state: str) -> Path:
    """Copy a run as it was in its last generation."""
    copied(run, to)
    cut(to, len((run / "missions.csv").read_bytes()) - 200)
    done = len([*(to / "generations").iterdir()])
    recorded = json.loads((to / "status.json").read_text())
    status = {**recorded, "state": state, "generations_done": done}
    (to / "status.json").write_text(json.dumps(status))
    return reseal(to)


def draw_figure(figure: str, run: Path) -> int:
    form = () if figure in ("deploy", "report") else ("--format", "svg")
    return evoros_analyze([figure, str(run), "--output", str(run.parent / "out"), *form])


def test_the_best_so_far_of_a_complete_search_is_the_champion(
    finished: Path, tmp_path: Path
) -> None:
    run = copied(finished, tmp_path / "run")
    (run / "status.json").write_text(
        json.dumps({**json.loads((run / "status.json").read_text()), "state": "running"})
    )
    reseal(run)
    champion, best = (
        read_champion(load_study([path]).records[0]).reset_index(drop=True)
        for path in (finished, run)
    )
    pd.testing.assert_frame_equal(champion, best, check_dtype=False)


@pytest.mark.slow
def test_a_running_run_is_shown_as_far_as_it_is(
    finished: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = interrupt(finished, tmp_path / "run", "running")
    done = len([*(run / "generations").iterdir()])
    last = pd.read_csv(run / "generations" / f"{done - 1:05d}.csv")
    best = int(last.sort_values("fitness")["id"].iloc[-1])
    for figure in ("fitness", "overlay", "panel", "mission", "course"):
        assert draw_figure(figure, run) == DONE
        error = capsys.readouterr().err
        assert error.count("\n") == 1, error
        assert f"generation {done} of 3" in error
    assert set(pd.read_csv(tmp_path / "out/overlay_sensors.csv").design) == {best}
    track = pd.read_csv(tmp_path / "out/mission.csv").query("world == 'near'")
    (file,) = run.glob(f"trajectories/00000/{best:06d}_near_0000.csv")
    assert track.x_m.to_list() == pd.read_csv(file).x_m.to_list()


@pytest.mark.parametrize("state", ["running", "stopped"])
@pytest.mark.parametrize("figure", STRICT)
def test_statistics_and_exports_need_a_finished_run(
    finished: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], figure: str, state: str
) -> None:
    run = interrupt(finished, tmp_path / "run", state)
    assert draw_figure(figure, run) == INPUT
    error = capsys.readouterr().err
    assert f"(state: {state})" in error
    assert ("evoros resume" in error) == (state == "stopped")
    assert ("evoros status" in error) == (state == "running")


def test_a_mission_that_is_not_kept_yet_is_named(
    finished: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = interrupt(finished, tmp_path / "run", "running")
    manifest = json.loads((run / "manifest.json").read_text())
    (run / "manifest.json").write_text(json.dumps({**manifest, "record": "champions"}))
    reseal(run)
    assert draw_figure("mission", run) == INPUT
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "trajectories" in error
    assert "record=champions" in error


def report(run: Path) -> str:
    assert draw_figure("report", run) == DONE
    return (run.parent / "out" / "report.html").read_text()


@pytest.mark.slow
def test_a_report_plays_the_best_so_far(finished: Path, tmp_path: Path) -> None:
    run = interrupt(finished, tmp_path / "run", "running")
    page = report(run)
    (label, player), *_ = re.findall(r'<script[^>]* data-label="(.*?)".*?>(.*)</script>', page)
    best = int(read_best(load_study([run]).records[0])["id"].iloc[0])
    content = json.loads(player)
    assert content["design"] == best
    assert label == "run, best so far"
    assert "Unfinished runs that have kept no missions" not in page
    for mission in content["missions"]:
        (file,) = run.glob(f"trajectories/00000/{best:06d}_{mission['world']}_0000.csv")
        begin = pd.read_csv(file).iloc[0]
        assert [mission["x"][0], mission["y"][0]] == pytest.approx(
            [1000 * begin.x_m, 1000 * begin.y_m], abs=0.5
        )


@pytest.mark.slow
def test_a_report_says_why_it_plays_nothing(finished: Path, tmp_path: Path) -> None:
    run = interrupt(finished, tmp_path / "run", "stopped")
    shutil.rmtree(run / "trajectories")
    page = report(run)
    assert "data-player=" not in page.partition("<script>")[0]
    assert "no missions of their best design so far: 1; see record=all" in page


@pytest.mark.parametrize(("ended", "title"), [(1, "1 champion, 1 best so far"), (0, "best so far")])
def test_an_overlay_tells_a_champion_from_the_best_so_far(
    ended: int, title: str, finished: Path, tmp_path: Path
) -> None:
    other = vary(finished, tmp_path / "other", {"seed": 7})
    paths = [interrupt(other, tmp_path / "unfinished", "running"), *[finished] * ended]
    product = overlay.make_product(load_study(paths), parse(["overlay", *map(str, paths)]))
    assert product.figure is not None
    assert product.figure.axes[0].get_title("left").splitlines()[0] == title
