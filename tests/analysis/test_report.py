"""The page of a report: whole, the same for the same input, and played in a real browser."""

import json
import re
import shutil
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pandas as pd
import pytest
from browser import chromium, complaints, requests
from helpers import reseal, scored, tiny
from selenium.webdriver import Chrome, Keys
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.ui import Select, WebDriverWait

from evoros.analysis.command import evoros_analyze
from evoros.analysis.figures import fitness as fitness_module
from evoros.analysis.figures.fitness import draw_fitness
from evoros.analysis.report.frame import embed_figure, format_table, make_section, render
from evoros.analysis.subcommands import parse
from evoros.analysis.tables.loading import load_study

EVIL = "<script>document.title='evil'<b>&amp;"
SECRET = "the-secret-of-the-environment"
FIGURES = ("overlay", "fitness", "compare", "transfer")
"""Figures of both treatments, of each run, with tests, and one that needs other folders."""


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of each of two treatments, and an evaluation of one's champion.

    The name and the configuration of the other run are not to be trusted.
    """
    folder = tmp_path_factory.mktemp("sweep")
    for failure in ("random", "spatial"):
        assert tiny(folder / failure, f"failure={failure}", "optimizer.generations=2") == 0
    scored(folder / "scored", folder / "spatial", "failure=random", "trials=2")
    evil = (folder / "random").rename(folder / EVIL)
    with (evil / "config.yaml").open("a") as config:
        config.write(f'note: "</pre>{EVIL}"\ntoken: ${{oc.env:EVOROS_TEST_TOKEN}}\n')
    reseal(evil)
    return folder


def page_of(*folders: Path, into: Path, claims: str | None = None) -> str:
    more = () if claims is None else ("--claims", claims)
    assert evoros_analyze(["report", *map(str, folders), "--output", str(into), *more]) == 0
    return (into / "report.html").read_text()


@pytest.fixture(scope="module")
def report(sweep: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("EVOROS_TEST_TOKEN", SECRET)
        patch.setattr("evoros.analysis.report.page.FIGURES", FIGURES)
        page_of(sweep, into=(into := tmp_path_factory.mktemp("page")))
    return into / "report.html"


class Elements(HTMLParser):
    """All elements of a page, and the text of each kind."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.all: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self._last = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.all.append((tag, dict(attrs)))
        self._last = tag

    def handle_data(self, data: str) -> None:
        self.texts.setdefault(self._last, []).append(data)


# Pieces ----------------------------------------------------------------------------------------


def generations(best: float) -> pd.DataFrame:
    return pd.DataFrame(
        {"generation": [0, 0, 1], "fitness": [1.0, 2.0, best], "validated_fitness": 1.5}
    )


def test_figures_of_one_page_share_no_name_and_point_at_nothing_else() -> None:
    pieces = [embed_figure(draw_fitness(generations(best)), f"figure{best:.0f}") for best in (3, 4)]
    page = Elements("".join(pieces))
    names = [attributes["id"] for _, attributes in page.all if attributes.get("id")]
    assert len(names) == len(set(names)) > 0
    pointed = re.findall(r'(?:url\(|href=")#([^)"]+)', "".join(pieces))
    assert pointed
    assert set(pointed) <= set(names)
    assert "http" not in "".join(pieces)
    assert "generation" in "".join(page.texts["text"])


def test_too_large_a_drawing_becomes_a_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evoros.analysis.report.frame.MAX_SVG", 100)
    ((tag, attributes),) = Elements(embed_figure(draw_fitness(generations(3.0)), "one")).all
    assert tag == "img"
    assert str(attributes["src"]).startswith("data:image/png;base64,iVBOR")


def test_numbers_of_a_column_have_the_same_decimals_and_text_is_escaped() -> None:
    frame = pd.DataFrame(
        {
            "<i>": ["<b>", "&", None],
            "fitness": [18.0, 8.7519, float("nan")],
            "p": [0.5, 0.000012, 0.04],
            "count": [1, 20, 300],
            "yes": [True, False, True],
        }
    )
    cells = [
        text
        for text in Elements(render("versions.html", versions=format_table(frame))).texts["td"]
        if text.strip()
    ]
    rows = [["<b>", "18.00", "0.5", "1", "yes"], ["&", "8.75", "1.2e-05", "20", "no"]]
    assert cells == [*rows[0], *rows[1], "0.04", "300", "yes"]


# The page --------------------------------------------------------------------------------------


def test_every_section_is_there_and_names_every_run(report: Path) -> None:
    page = Elements(report.read_text())
    headings = page.texts["h2"]
    assert [text for text in headings if text.strip()] == [
        "Findings",
        "Statistics",
        "Figures",
        "Player",
        "Summary",
        "Configuration",
        "Made with",
    ]
    cells = page.texts["td"]
    assert EVIL in cells
    assert "spatial" in cells


def test_names_and_configurations_are_text_and_no_element(report: Path) -> None:
    page = Elements(report.read_text())
    assert [attributes.get("type") for tag, attributes in page.all if tag == "script"] == [
        "application/json",
        "application/json",
        "application/json",  # the grounds that designs of maps share
        None,
    ]
    assert any(f"</pre>{EVIL}" in text for text in page.texts["pre"])


def test_nothing_outside_of_the_page_is_named_and_no_secret_is_in_it(report: Path) -> None:
    page = report.read_text()
    assert "http:" not in page
    assert "https:" not in page
    assert "oc.env:EVOROS_TEST_TOKEN" in page
    assert SECRET not in page
    sources = [a[key] for _, a in Elements(page).all for key in ("src", "href") if a.get(key)]
    assert all(str(source).startswith(("#", "data:")) for source in sources)


@pytest.fixture(scope="module")
def single(sweep: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page of one run."""
    return page_of(sweep / "spatial", into=tmp_path_factory.mktemp("single"))


def test_what_does_not_apply_is_a_folded_line_of_why(report: Path) -> None:
    page = report.read_text()
    assert "<h3>Bag</h3>" not in page  # an export, which is no figure
    assert "<h3>Transfer</h3>" not in page
    (folded,) = re.findall(r"<summary>Figures that do not apply.*?</details>", page, re.S)
    assert "<details open" not in page.split("Figures that do not apply")[0][-40:]
    assert folded.count("<li>transfer: ") == 1


@pytest.mark.slow
def test_claims_and_figures_of_the_paper_are_there_only_if_asked_for(
    sweep: Path, single: str, tmp_path: Path
) -> None:
    judged = page_of(sweep / "spatial", into=tmp_path, claims="paper")
    assert "Fig. " not in single
    assert 'id="claims"' not in single
    assert 'id="claims"' in judged


def test_a_fault_in_a_figure_costs_that_figure_alone(
    sweep: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("<oh>\nno")

    monkeypatch.setattr(fitness_module, "make_product", broken)
    options = parse(["report", str(sweep / "spatial")])
    study = load_study(options.folders)
    names = ("fitness", "regions")
    page = {name: make_section(name, study, options).render(False) for name in names}
    assert "ZeroDivisionError: &lt;oh&gt; no" in page["fitness"]
    assert "<svg" in page["regions"]
    assert caplog.messages == ["fitness: cannot be drawn (ZeroDivisionError: <oh> no); left out"]


def test_an_unfinished_run_has_a_page_without_a_player_and_a_damaged_one_is_named(
    sweep: Path, tmp_path: Path
) -> None:
    for name in ("half", "damaged"):
        shutil.copytree(sweep / "spatial", tmp_path / name)
    status = tmp_path / "half" / "status.json"
    status.write_text(json.dumps({**json.loads(status.read_text()), "state": "running"}))
    for name in ("half", "damaged"):
        reseal(tmp_path / name)
    (tmp_path / "damaged" / "setting.json").write_text("{")
    page = page_of(tmp_path, into=tmp_path / "figures")
    assert "There are no missions to be played." in page
    assert "no missions of their best design so far: 1; see record=all" in page
    assert "<canvas" not in page
    assert "Left out (1)" in page
    assert "damaged/setting.json" in page


def test_runs_and_evaluations_are_configured_apart(report: Path) -> None:
    page = report.read_text()
    begin, end = (page.index(f'<section id="{name}">') for name in ("configuration", "made-with"))
    first, second = page[begin:end].split("<h3>Evaluations</h3>")
    assert "config.yaml of spatial" in first
    assert "SpatialFailure" in first
    assert "config.yaml of scored" in second  # the only treatment of its kind
    assert "RandomFailure" in second
    assert "SpatialFailure" not in second


# In a browser ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser(report: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    with chromium(tmp_path_factory.mktemp("profile")) as browser:
        browser.get(report.as_uri())
        yield browser
        assert complaints(browser) == []
        assert requests(browser) == [report.as_uri()]


@pytest.fixture
def player(browser: Chrome) -> WebElement:
    """The player, at the beginning of the first mission."""
    player = browser.find_element("css selector", "[data-player]")
    seek(browser, player, 0.0)
    return player


def part(player: WebElement, name: str) -> WebElement:
    return player.find_element("css selector", f'[data-part="{name}"]')


def seek(browser: Chrome, player: WebElement, time_s: float) -> None:
    browser.execute_script(
        "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'));",
        part(player, "scrub"),
        time_s,
    )


def number(player: WebElement, name: str) -> float:
    return float(player.get_attribute(f"data-{name}") or "nan")


def pixels(browser: Chrome, player: WebElement) -> dict[str, str]:
    """The content of each canvas."""
    names = ("course", "close", "readings", "timeline")
    script = "return arguments[0].toDataURL()"
    return {name: browser.execute_script(script, part(player, name)) for name in names}


def test_the_page_opens_and_its_name_is_that_of_the_folder(browser: Chrome, sweep: Path) -> None:
    assert browser.title == sweep.name
    options = browser.find_elements("css selector", '[data-part="run"] option')
    assert [option.get_property("text") for option in options] == [
        "random, seed 0",
        "spatial, seed 0",
    ]


def test_play_moves_the_time_and_every_picture(browser: Chrome, player: WebElement) -> None:
    before = pixels(browser, player)
    part(player, "play").click()
    WebDriverWait(browser, 60, 0.05).until(lambda _: number(player, "time") > 1.0)
    part(player, "play").click()
    WebDriverWait(browser, 60, 0.05).until(
        lambda _: player.get_attribute("data-playing") == "false"
    )
    stopped = number(player, "time")
    after = pixels(browser, player)
    assert all(after[name] != before[name] for name in before)
    assert pixels(browser, player) == after
    assert number(player, "time") == stopped


@pytest.mark.parametrize("record", [0, 17, 101, 130])
def test_the_robot_is_where_the_trajectory_says_and_reads_what_it_read(
    browser: Chrome, player: WebElement, sweep: Path, record: int
) -> None:
    run = load_study([sweep / EVIL]).records[0].run
    row = run.trajectory("near").iloc[record]
    seek(browser, player, float(row["time_s"]))
    assert number(player, "time") == pytest.approx(row["time_s"], abs=0.051)
    assert number(player, "x") == pytest.approx(row["x_m"], abs=0.001)
    assert number(player, "y") == pytest.approx(row["y_m"], abs=0.001)
    readings = (player.get_attribute("data-readings") or "").split(" ")
    for sensor, reading in enumerate(readings):
        recorded = row[f"range_{sensor}_m"]
        assert reading == ("" if pd.isna(recorded) else pytest.approx(f"{recorded:.3f}"))


def test_a_sensor_that_failed_is_named(browser: Chrome, player: WebElement, sweep: Path) -> None:
    missions = load_study([sweep / EVIL]).records[0].run
    flown = missions.trajectory("near")
    (sensor,) = [i for i in range(6) if flown[f"range_{i}_m"].isna().any()]
    assert player.get_attribute("data-failed") == ""
    seek(browser, player, float(flown["time_s"].iloc[-1]))
    assert player.get_attribute("data-failed") == str(sensor)
    assert f"sensor {sensor} failed at" in part(player, "status").text


def test_keys_play_and_move(browser: Chrome, player: WebElement) -> None:
    player.send_keys(Keys.ARROW_RIGHT)
    assert number(player, "time") == pytest.approx(1.0)
    player.send_keys(Keys.SHIFT, Keys.ARROW_RIGHT)
    assert number(player, "time") == pytest.approx(11.0)
    player.send_keys(Keys.HOME)
    assert number(player, "time") == 0.0
    speed = Select(part(player, "speed"))
    speed.select_by_value("1")  # or the mission could end before the second key
    for playing in ("true", "false"):
        player.send_keys(Keys.SPACE)
        assert player.get_attribute("data-playing") == playing
    speed.select_by_value("10")


def test_another_world_and_run_are_played(browser: Chrome, player: WebElement) -> None:
    part(player, "world").send_keys("far")
    assert player.get_attribute("data-world") == "far"
    part(player, "run").send_keys("spatial")
    assert player.get_attribute("data-run") == "spatial"
    assert player.get_attribute("data-world") == "far"
    part(player, "run").send_keys("random")
    part(player, "world").send_keys("near")


def test_a_table_sorts_by_the_heading_that_is_clicked(browser: Chrome) -> None:
    summary = browser.find_element("css selector", "#summary table")

    heads = summary.find_elements("css selector", "th button")
    place = [head.text for head in heads].index("recorded")
    head = heads[place]

    def column() -> list[float]:
        cells = summary.find_elements("css selector", f"tbody td:nth-child({place + 1})")
        return [float(cell.text) for cell in cells]

    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", head)
    head.click()
    assert column() == sorted(column())
    head.click()
    assert column() == sorted(column(), reverse=True)


def test_a_dark_screen_changes_the_colours(browser: Chrome, player: WebElement) -> None:
    before = pixels(browser, player)
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    WebDriverWait(browser, 60, 0.05).until(
        lambda _: pixels(browser, player)["course"] != before["course"]
    )
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.mark.slow
def test_it_prints_without_a_complaint(browser: Chrome, player: WebElement) -> None:
    assert browser.print_page()
    assert player.is_displayed()


@pytest.mark.slow
def test_no_other_script_runs_than_that_of_the_page(browser: Chrome) -> None:
    browser.execute_script(
        "const s = document.createElement('script'); s.textContent = \"document.title = 'evil'\";"
        "document.body.append(s);"
    )
    assert browser.title != "evil"
    assert any("Content Security Policy" in line for line in complaints(browser))
