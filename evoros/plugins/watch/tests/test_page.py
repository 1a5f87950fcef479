"""The page in a browser while a run goes on, is killed, is resumed and ends."""

import fcntl
import json
import shutil
import signal
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from browser import CONTRAST, chromium, complaints, emulate, requests
from helpers import ROOT, copied, cut, finished_run, resume, start
from selenium.webdriver import Chrome
from selenium.webdriver.support.ui import WebDriverWait

from evoros.storage.layout import seal_json
from evoros.terminal.console import DONE, INTERRUPTED

pytestmark = pytest.mark.slow
PATIENCE_S = 120.0
FITS = "return document.documentElement.scrollWidth <= innerWidth"


class Stage:
    """A folder in which a run appears, goes on, is killed and resumed, step by step.

    With this seed, each generation has a better design, so that the missions are others, too.
    """

    def __init__(self, folder: Path) -> None:
        self.whole = finished_run(folder / "whole", "record=all", "seed=1")
        self.run = folder / "watched"

    def appear(self, generations: int, age_s: float = -3600.0) -> None:
        """Let the run have so many finished generations, at once, as a run would have it."""
        draft = self.run.parent / ".draft"
        shutil.rmtree(draft, ignore_errors=True)
        rows = (self.whole / "missions.csv").read_bytes().splitlines(keepends=True)
        wanted = [row for row in rows[1:] if int(row.split(b",")[0]) <= generations]
        cut(copied(self.whole, draft), len(rows[0]) + sum(map(len, wanted)) - 20)
        status = json.loads((draft / "status.json").read_text())
        updated = datetime.now(UTC) - timedelta(seconds=age_s)
        status["updated"] = updated.isoformat(timespec="seconds")
        del status["digest"]
        (draft / "status.json").write_text(seal_json("status.json", status))
        shutil.rmtree(self.run, ignore_errors=True)
        draft.rename(self.run)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    return Stage(tmp_path_factory.mktemp("stage"))


@pytest.fixture(scope="module")
def address(stage: Stage) -> Iterator[str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(ROOT / "tests"))
        entry = "evoros.plugins.watch.tests.hasty_watch"
        process = start(["watch", str(stage.run)], stage.run.parent, entry)
    assert process.stdout is not None
    yield process.stdout.readline().strip()
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    assert (process.returncode, error.splitlines()[-1]) == (
        INTERRUPTED,
        "evoros watch: interrupted",
    )


@pytest.fixture(scope="module")
def browser(address: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    with chromium(tmp_path_factory.mktemp("profile")) as browser:
        browser.get(address)
        yield browser
        assert complaints(browser) == []
        assert all(asked.startswith(address) for asked in requests(browser))


def wait(browser: Chrome, until: Callable[[], object]) -> None:
    WebDriverWait(browser, PATIENCE_S, 0.2).until(lambda _: until())


def tiles(browser: Chrome) -> str:
    script = "return document.querySelector('.tiles').innerText"
    return str(browser.execute_script(script)).replace("\n", " ")


def individuals(browser: Chrome) -> int:
    """The number of designs in the figure of the fitness, by the numbers below it."""
    script = """
    const heads = [...document.querySelectorAll("#figures h3")];
    const head = heads.find((each) => each.textContent === "Fitness");
    for (let next = head?.nextElementSibling; next; next = next.nextElementSibling)
      if (next.tagName === "DETAILS") return next.querySelectorAll("tbody tr").length;
    return 0;"""
    return int(browser.execute_script(script))


def count_rows(run: Path) -> int:
    tables = (run / "generations").iterdir()
    return sum(len(table.read_text().splitlines()) - 1 for table in tables)


def test_it_follows_a_run_from_nothing_over_a_kill_to_its_end(
    browser: Chrome, stage: Stage
) -> None:
    assert "waiting" in tiles(browser)
    assert "has no run yet" in browser.find_element("id", "progress").text
    stage.appear(1)
    wait(browser, lambda: "running" in tiles(browser) and "1 of 3" in tiles(browser))
    wait(browser, lambda: individuals(browser) == count_rows(stage.run) > 0)
    before = individuals(browser)

    stage.appear(2)
    wait(browser, lambda: "2 of 3" in tiles(browser))
    wait(browser, lambda: individuals(browser) == count_rows(stage.run) > before)

    stage.appear(2, age_s=60.0)
    wait(browser, lambda: "killed" in tiles(browser))
    with (stage.run / "missions.csv").open("rb") as missions:
        fcntl.flock(missions, fcntl.LOCK_EX | fcntl.LOCK_NB)  # the watcher holds no lock

    assert resume(stage.run) == DONE
    wait(browser, lambda: "finished" in tiles(browser) and "3 of 3" in tiles(browser))
    wait(browser, lambda: individuals(browser) == count_rows(stage.run))
    assert "generation 2/2" in browser.find_element("css selector", ".log").text
    status = json.loads((stage.run / "status.json").read_text())
    assert f"{status['best_fitness']:.3f}" in tiles(browser)


def test_a_mission_that_plays_goes_on_and_what_was_opened_stays(
    browser: Chrome, stage: Stage
) -> None:
    stage.appear(1)
    wait(browser, lambda: "1 of 3" in tiles(browser))
    wait(browser, lambda: individuals(browser) == count_rows(stage.run))
    browser.execute_script("""
        const player = document.querySelector("[data-player]"), find = (name) =>
          player.querySelector(`[data-part="${name}"]`);
        player.dataset.mine = "kept";
        find("speed").selectedOptions[0].value = "0.01"; // it plays until the end of the test
        find("play").click();
        document.querySelector("#figures details").open = true;
        document.querySelector("#summary").scrollIntoView();
    """)
    top = "return document.querySelector('#summary').getBoundingClientRect().top"
    place = browser.execute_script(top)
    stage.appear(2)
    wait(browser, lambda: individuals(browser) == count_rows(stage.run))
    player = browser.find_element("css selector", "[data-player]")
    assert player.get_attribute("data-mine") == "kept"
    assert player.get_attribute("data-playing") == "true"
    assert browser.execute_script("return document.querySelector('#figures details').open")
    assert browser.execute_script(top) == pytest.approx(place, abs=2)
    show = browser.find_element("css selector", ".live button")
    wait(browser, show.is_displayed)
    show.click()
    wait(browser, lambda: not show.is_displayed())
    assert browser.find_element("css selector", "[data-player]").get_attribute("data-time") == (
        "0.000"
    )


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1280])
def test_it_fits_and_can_be_read(browser: Chrome, width: int, scheme: str) -> None:
    emulate(browser, width, scheme)
    assert browser.execute_script(FITS)
    assert min(browser.execute_script(CONTRAST)) >= 4.5
    emulate(browser, 1280, "light")
