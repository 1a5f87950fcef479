"""Figures of runs that are not finished, which show the best individual so far."""

import json
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest
from helpers import copied, cut, reseal, tiny, vary

from evoros.analysis.command import evoros_analyze
from evoros.analysis.figures import overlay
from evoros.analysis.subcommands import parse
from evoros.analysis.tables.champions import read_champion
from evoros.analysis.tables.designs import read_best
from evoros.analysis.tables.loading import load_study
from evoros.terminal.console import DONE, INPUT


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unfinished") / "run"
    assert tiny(folder, "record=all") == DONE
    return folder


def interrupt(run: Path, to: Path, state: str) -> Path:
    """Copy a run as it was in its last generation."""
    copied(run, to)
    cut(to, len((run / "missions.csv").read_bytes()) - 200)
    done = len([*(to / "generations").iterdir()])
    recorded = json.loads((to / "status.json").read_text())
    status = {**recorded, "state": state, "generations_done": done}
    (to / "status.json").write_text(json.dumps(status))
    return reseal(to)


def analyze(figure: str, run: Path) -> int:
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
        assert analyze(figure, run) == DONE
        error = capsys.readouterr().err
        assert error.count("\n") == 1, error
        assert f"generation {done} of 3" in error
    assert set(pd.read_csv(tmp_path / "out/overlay_sensors.csv").design) == {best}
    track = pd.read_csv(tmp_path / "out/mission.csv").query("world == 'near'")
    (file,) = run.glob(f"trajectories/00000/{best:06d}_near_0000.csv")
    assert track.x_m.to_list() == pd.read_csv(file).x_m.to_list()


@pytest.mark.parametrize("state", ["running", "stopped"])
@pytest.mark.parametrize("figure", ["compare", "claims", "deploy"])
def test_statistics_and_exports_need_a_finished_run(
    finished: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], figure: str, state: str
) -> None:
    run = interrupt(finished, tmp_path / "run", state)
    assert analyze(figure, run) == INPUT
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
    assert analyze("mission", run) == INPUT
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "trajectories" in error
    assert "record=champions" in error


def report(run: Path) -> str:
    assert analyze("report", run) == DONE
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
