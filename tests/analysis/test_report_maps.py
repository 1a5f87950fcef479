"""The archive and the front in the page of a report: a design is chosen, appears and is played."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest
from browser import chromium, complaints, find_map, press
from helpers import finished_run
from selenium.webdriver import Chrome

from evoros.analysis.command import evoros_analyze
from evoros.analysis.report.maps import make_maps
from evoros.analysis.report.page import collect_missions
from evoros.analysis.subcommands import parse
from evoros.analysis.tables.loading import load_study
from evoros.storage.reading import load_run
from evoros.storage.trajectory_files import trajectory_file
from evoros.terminal.console import DONE

pytestmark = pytest.mark.slow  # test_report_pages.py has another page's archive in a browser

SEARCH = (
    "optimizer=map_elites",
    "optimizer.population_size=6",
    "optimizer.generations=1",
    "optimizer.validation_trials=0",
    "~optimizer.mutation_probability",
    "+measure@objectives.fitness=fitness",
    "+measure@objectives.coverage=coverage",
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finished_run(tmp_path_factory.mktemp("maps") / "run", *SEARCH)


@pytest.fixture(scope="module")
def page(run: Path) -> Path:
    assert evoros_analyze(["report", str(run), "--output", str(run.parent / "page")]) == DONE
    return run.parent / "page" / "report.html"


@pytest.fixture(scope="module")
def browser(page: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    with chromium(tmp_path_factory.mktemp("profile")) as browser:
        browser.get(page.as_uri())
        yield browser
        assert complaints(browser) == []


@pytest.mark.parametrize("name", ["archive", "front"])
def test_each_design_can_be_chosen_and_its_own_mission_is_played(
    name: str, run: Path, browser: Chrome
) -> None:
    assert evoros_analyze([name, str(run), "--format", "svg"]) == DONE
    listed = pd.read_csv(run / "figures" / f"{name}.csv")
    chooser, marks, player = find_map(browser, name)
    assert len(marks) == len(listed) > 1
    kept = load_run(run)
    for mark, row in zip(marks, listed.to_dict("records"), strict=True):
        press(browser, mark)
        assert chooser.get_attribute("data-chosen") == f"{run.name}/{row['id']}"
        assert mark.get_attribute("aria-checked") == "true"
        assert f"fitness {row['fitness']:.2f}" in (mark.get_attribute("aria-label") or "")
        mission = kept.missions[kept.missions.design == row["id"]].iloc[0]
        keys = (int(mission.generation), int(mission.design), mission.world, int(mission.trial))
        if not (run / trajectory_file(keys)).is_file():
            assert name == "front"  # of all designs; those of the archive have theirs
            assert not player.is_displayed()
            continue
        assert player.get_attribute("data-design") == str(row["id"])
        world = str(player.get_attribute("data-world"))
        begin = kept.mission_trajectory(*keys[:2], world, keys[3]).iloc[0]
        place = [float(player.get_attribute(f"data-{axis}") or "nan") for axis in "xy"]
        assert place == pytest.approx([begin.x_m, begin.y_m], abs=0.001)


def test_a_narrow_screen_shows_all_of_it(browser: Chrome) -> None:
    size = {"width": 400, "height": 900, "deviceScaleFactor": 1, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= 400
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def rendered(run: Path, max_bytes: float) -> str:
    study = load_study([run])
    maps = make_maps(study, parse(["report", str(run)]))
    missions = collect_missions(maps, study, max_bytes)
    assert sum(map(len, missions.playbacks.values())) <= max_bytes
    return "".join(missions.render(item) for item in maps.values())


def test_what_cannot_be_played_is_told(run: Path, tmp_path: Path) -> None:
    none = rendered(run, 0.0)
    assert "are left out to limit the page's size; see --designs" in none
    assert "data-player=" not in none
    shutil.copytree(run, bare := tmp_path / "bare")
    shutil.rmtree(bare / "trajectories")
    bare_page = rendered(bare, 1e9)
    assert "the runs kept no trajectories; see record=champions" in bare_page
    assert "see --designs" not in bare_page
    assert none.count('role="radio"') == bare_page.count('role="radio"') > 0
