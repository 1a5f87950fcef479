"""The page of a report in a browser at three widths, light and dark: its begin, and what fits.

Also an archive in it, of whose designs one is chosen.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import CONTRAST, chromium, emulate, find_map, press
from helpers import tiny
from selenium.webdriver import Chrome, Keys

from evoros.analysis.command import evoros_analyze
from evoros.analysis.report.summary import list_findings
from evoros.analysis.tables.loading import load_study
from evoros.terminal.console import DONE

pytestmark = pytest.mark.slow

LONG = "a_treatment_whose_name_is_longer_than_any_card_of_a_page_on_a_telephone_can_be_wide"
SCREENS = [(400, "light"), (800, "dark"), (1400, "light")]
SEARCH = ("optimizer=map_elites", "optimizer.generations=1", "~optimizer.mutation_probability")

OUTSIDE = """
const found = [], cards = "header, nav, .player, .chooser, .findings, .bar, dl";
for (const card of document.querySelectorAll(cards)) {
  const edge = card.getBoundingClientRect();
  for (const part of card.querySelectorAll("*")) {
    const box = part.getBoundingClientRect();
    if (box.width && part.tagName !== "OPTION" && box.right > edge.right + 1)
      found.push(`${card.className || card.tagName}: ${part.tagName} ${box.right - edge.right}`);
  }
}
return found;
"""
TABLES = """
const boxes = [...document.querySelectorAll(".table")].filter((box) => box.clientWidth);
return boxes.map((box) => ({
  scrolls: box.scrollWidth - box.clientWidth > 1 || box.scrollHeight - box.clientHeight > 1,
  wide: box.scrollWidth - box.clientWidth > 1,
  more: box.dataset.more || "",
  told: !box.nextElementSibling.hidden && box.nextElementSibling.textContent,
}));
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pages") / LONG
    for failure in ("random", "spatial"):
        assert tiny(folder / f"{LONG}_{failure}", f"failure={failure}", *SEARCH) == DONE
    return folder


@pytest.fixture(scope="module")
def browser(study: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    into = tmp_path_factory.mktemp("report")
    assert evoros_analyze(["report", str(study), "--output", str(into)]) == DONE
    with chromium(tmp_path_factory.mktemp("profile")) as browser:
        browser.get((into / "report.html").as_uri())
        browser.execute_script(
            "document.querySelectorAll('details').forEach((each) => { each.open = true; })"
        )
        yield browser


@pytest.fixture(params=SCREENS, ids=str)
def page(browser: Chrome, request: pytest.FixtureRequest) -> Chrome:
    """The page on a screen of a width, light or dark, once it is laid out."""
    width, scheme = request.param
    emulate(browser, width, scheme)
    assert browser.execute_script("return innerWidth") == width
    return browser


def test_nothing_is_wider_than_the_page_or_than_its_card(page: Chrome) -> None:
    assert page.execute_script("return document.documentElement.scrollWidth - innerWidth") <= 0
    assert page.execute_script(OUTSIDE) == []


def test_a_table_that_scrolls_shows_and_says_so(page: Chrome) -> None:
    tables = page.execute_script(TABLES)
    assert tables
    for table in tables:
        assert bool(table["more"]) == bool(table["told"]) == table["scrolls"]
        assert ("right" in table["more"].split()) == table["wide"]
    assert any(table["wide"] for table in tables) or page.execute_script("return innerWidth") > 400


def test_figures_fit_and_ticks_are_on_one_line(page: Chrome) -> None:
    assert (
        page.execute_script(
            "return [...document.querySelectorAll('.paper')]"
            "  .filter((box) => box.scrollWidth > box.clientWidth + 1).length"
        )
        == 0
    )
    heights = page.execute_script(
        "return [...document.querySelectorAll('.tick')].map((tick) => tick.clientHeight)"
    )
    assert len(heights) > 4
    assert len(set(heights)) == 1


def test_all_text_can_be_read(page: Chrome) -> None:
    assert min(page.execute_script(CONTRAST)) >= 4.5  # as WCAG 2 asks for text of this size


def test_a_table_shows_its_other_side_when_it_is_scrolled(browser: Chrome) -> None:
    screen = {"width": 400, "height": 1400, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
    more = browser.execute_async_script(
        "const done = arguments[0];"
        "const box = [...document.querySelectorAll('.table')]"
        "  .find((each) => each.scrollWidth > each.clientWidth + 1);"
        "box.scrollLeft = box.scrollWidth;"
        "requestAnimationFrame(() => requestAnimationFrame(() => done(box.dataset.more)));"
    )
    assert "left" in more.split()
    assert "right" not in more.split()


def test_the_page_opens_with_what_is_better_and_how_sure(browser: Chrome, study: Path) -> None:
    first = browser.find_element("css selector", "main section")
    assert first.get_attribute("id") == "findings"
    expected, missing = list_findings(load_study([study]))
    items = first.find_elements("css selector", "li")
    shown = [str(item.get_property("textContent")) for item in items]
    assert (shown, missing) == (expected, "")
    assert any("versus" in line for line in shown)
    assert (
        sum("median" in line and "may cover the true value in fewer" not in line for line in shown)
        == 2
    )
    order = browser.execute_script(
        "const at = (rule) => [...document.querySelectorAll('main section')]"
        "  .findIndex((each) => each.matches(rule));"
        "return ['#findings', '#figures', '#summary'].map(at)"
    )
    assert order == sorted(order)


def test_arrows_move_to_a_neighbour_and_the_player_names_what_it_plays(browser: Chrome) -> None:
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    chooser, marks, player = find_map(browser, "archive-1")  # of one treatment

    def chosen_id() -> str:
        return str(chooser.get_attribute("data-chosen")).rpartition("/")[2]

    by_x = sorted(marks, key=lambda mark: float(mark.get_attribute("data-x") or "nan"))
    press(browser, by_x[0])
    for _ in marks:
        browser.switch_to.active_element.send_keys(Keys.ARROW_RIGHT)
    active = browser.switch_to.active_element
    assert active != by_x[0]
    assert active.get_attribute("aria-checked") == "true"
    assert chosen_id() == player.get_attribute("data-design")
    assert [mark.get_attribute("tabindex") for mark in marks].count("0") == 1
    select = player.find_element("css selector", '[data-part="run"]')
    first = select.find_elements("css selector", "option")[0]
    first.click()
    assert f"design {player.get_attribute('data-design')}" in str(first.get_property("text"))
    assert chosen_id() == player.get_attribute("data-design")
