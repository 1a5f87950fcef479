"""The page of an evaluation with requirements: verdicts, and worst missions to be played."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from browser import CONTRAST, chromium, complaints, emulate, press, requests
from fixture_types import Capture, Folders
from helpers import TINY, refused
from proposal_sites import is_of
from selenium.webdriver import Chrome

from evoros.analysis.command import evoros_analyze
from evoros.cli.command import evaluate, resume
from evoros.cli.main import evoros
from evoros.session import worst_case_run
from evoros.session.diff import diff_runs
from evoros.terminal.console import DONE, NOT_MET

CLAIMS = {
    "easy": "{of: time_s, at_least: 0, share: 0.8}",
    "hard": "{of: distance_m, at_most: -1, share: 0.8}",
    "close": "{of: progress, at_least: 0.9, confidence: 0.999}",
}


def required(folder: Path, *more: str, claims: tuple[str, ...] = tuple(CLAIMS)) -> int:
    (folder.parent / "one.csv").write_text("design,sensor,x_m,y_m,yaw_deg\na,0,0.2,0,0\n")
    places = ("executor=serial", f"hydra.run.dir={folder}", f"designs={folder.parent}/one.csv")
    typed = [f"+requirements.{name}={CLAIMS[name]}" for name in claims]
    return evaluate([*TINY, *places, "trials=20", *typed, *more])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: Folders) -> Path:
    path = tmp_path_factory.mktemp("required") / "tested"
    assert required(path) == NOT_MET
    return path


def worst(folder: Path) -> pd.DataFrame:
    rows = pd.read_csv(folder / "requirements.csv")
    return rows[rows["result"] != "met"]


def test_the_trajectories_of_the_worst_missions_are_those_of_a_replay(
    folder: Path, tmp_path: Path
) -> None:
    rows = worst(folder)
    assert set(rows["requirement"]) == {"hard", "close"}
    for row in rows.to_dict("records"):
        place = f"{row['worst_world']}_{row['worst_trial']:04d}"
        kept = folder / f"trajectories/00000/000000_{place}.csv"
        columns = [f"world={row['worst_world']}", f"trial={row['worst_trial']}"]
        replay = ["replay", str(folder), *columns, f"--output={tmp_path / 'again.csv'}"]
        assert evoros([*replay, *TINY[:2]]) == DONE
        assert kept.read_bytes() == (tmp_path / "again.csv").read_bytes()
    files = list((folder / "trajectories" / "00000").iterdir())
    assert len(files) == len(rows[["worst_world", "worst_trial"]].drop_duplicates())


def test_the_worst_kept_missions_are_shown_as_those_of_a_champion(
    folder: Path, tmp_path: Path, capsys: Capture
) -> None:
    assert evoros_analyze(["mission", str(folder), f"--output={tmp_path}"]) == DONE
    said = capsys.readouterr().out
    shown = pd.read_csv(tmp_path / "mission.csv")
    missions = pd.read_csv(folder / "missions.csv").sort_values(
        ["completed", "progress", "collisions", "time_s"], ascending=[True, True, False, False]
    )
    poses, kept = ["x_m", "y_m", "yaw_rad"], dict[str, pd.DataFrame]()
    for row in missions.itertuples():
        file = folder / "trajectories" / "00000" / f"000000_{row.world}_{row.trial:04d}.csv"
        if file.is_file():
            if not kept:
                assert (
                    f"the worst kept mission is design a, trial {row.trial} in {row.world}" in said
                )
            kept.setdefault(str(row.world), pd.read_csv(file)[poses])
    assert set(shown["world"]) == set(kept)
    for world, track in shown.groupby("world"):
        assert np.allclose(track[poses], kept[str(world)])


def test_an_evaluation_that_keeps_no_mission_has_none_to_show(
    folder: Path, tmp_path: Path, capsys: Capture
) -> None:
    shutil.copytree(folder, tmp_path / "bare", ignore=shutil.ignore_patterns("trajectories"))
    words = ["mission", str(tmp_path / "bare"), f"--output={tmp_path / 'out'}"]
    error = refused(lambda: evoros_analyze(words), capsys)
    assert "bare: no trajectory of a mission was kept; evaluate with" in error
    assert is_of(error, "analysis/tables/shown.py record=all")
    assert required(tmp_path / "all", "record=all", claims=()) == DONE
    assert evoros_analyze(["mission", str(tmp_path / "all"), f"--output={tmp_path}"]) == DONE


def test_a_lost_trajectory_and_page_are_made_again(folder: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    shutil.copytree(folder, again)
    lost = next((again / "trajectories" / "00000").iterdir())
    content = lost.read_bytes()
    lost.unlink()
    (again / "figures" / "requirements.html").unlink()
    assert resume([str(again), *TINY[:2]]) == NOT_MET
    assert lost.read_bytes() == content
    assert (again / "figures" / "requirements.html").is_file()
    assert diff_runs(folder, again).difference == ""  # though the pages name their folders


def test_missions_that_are_recorded_are_not_run_again(folder: Path, tmp_path: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(worst_case_run, "_run_again", None)
        assert required(tmp_path / "all", "record=all") == NOT_MET
    for file in (folder / "trajectories" / "00000").iterdir():
        twin = tmp_path / "all" / "trajectories" / "00000" / file.name
        assert twin.read_bytes() == file.read_bytes()
    assert "data-plays=" in (tmp_path / "all" / "figures" / "requirements.html").read_text()


def test_a_mission_that_ends_otherwise_is_not_played(tmp_path: Path, capsys: Capture) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(worst_case_run, "are_recorded", lambda *_: False)
        assert required(tmp_path / "live", claims=("hard",)) == NOT_MET
    assert "had a different outcome when rerun; its trajectory is not kept" in (
        capsys.readouterr().err
    )
    page = (tmp_path / "live" / "figures" / "requirements.html").read_text()
    assert "data-plays=" not in page
    assert "no trajectory was kept of trial 0 in " in page


def test_nothing_is_kept_if_all_is_met_or_nothing_is_to_be_recorded(tmp_path: Path) -> None:
    assert required(tmp_path / "met", claims=("easy",)) == DONE
    assert required(tmp_path / "none", "record=none", claims=("hard",)) == NOT_MET
    for name in ("met", "none"):
        assert not (tmp_path / name / "trajectories").exists()
        page = (tmp_path / name / "figures" / "requirements.html").read_text()
        assert 'class="player"' not in page


def test_without_requirements_there_is_no_page(tmp_path: Path, capsys: Capture) -> None:
    assert required(tmp_path / "plain", claims=()) == DONE
    assert not (tmp_path / "plain" / "figures").exists()
    capsys.readouterr()
    told = refused(lambda: evoros_analyze(["requirements", str(tmp_path / "plain")]), capsys)
    assert "requirements: no finished evaluation with requirements was found" in told


# In a browser ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser(folder: Path, tmp_path_factory: Folders) -> Iterator[Chrome]:
    with chromium(tmp_path_factory.mktemp("profile")) as browser:
        browser.get((folder / "figures" / "requirements.html").as_uri())
        yield browser


def test_it_loads_nothing_and_lists_what_is_required(browser: Chrome, folder: Path) -> None:
    assert requests(browser) == [browser.current_url]
    assert complaints(browser) == []
    rows = browser.find_elements("css selector", ".verdicts tbody tr")
    shown = [row.text.split()[:2] for row in rows]
    table = pd.read_csv(folder / "requirements.csv")
    assert sorted(shown) == sorted([row.result, row.requirement] for row in table.itertuples())
    assert [result for result, _ in shown] == ["violated", "undecided", "met"]


def test_each_button_plays_the_worst_mission(browser: Chrome, folder: Path) -> None:
    player = browser.find_element("css selector", '[data-player="verdict"]')
    missions = pd.read_csv(folder / "missions.csv")
    times = dict(
        zip(zip(missions["world"], missions["trial"], strict=True), missions["time_s"], strict=True)
    )
    buttons = browser.find_elements("css selector", "[data-plays]")
    assert len(buttons) == 2
    for button, row in zip(buttons, worst(folder).itertuples(), strict=True):
        press(browser, button)
        assert player.get_attribute("data-world") == row.worst_world
        browser.execute_script(
            "const scrub = arguments[0].querySelector('[data-part=scrub]');"
            "scrub.value = scrub.max; scrub.dispatchEvent(new Event('input'));",
            player,
        )
        ended = times[row.worst_world, row.worst_trial]
        assert float(player.get_attribute("data-time") or 0) == pytest.approx(ended, abs=0.11)
    assert complaints(browser) == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1280])
def test_it_fits_and_can_be_read(browser: Chrome, width: int, scheme: str) -> None:
    emulate(browser, width, scheme)
    assert browser.execute_script("return document.documentElement.scrollWidth - innerWidth") <= 0
    assert min(browser.execute_script(CONTRAST)) >= 4.5
