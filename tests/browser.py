"""A real browser for the tests: Chromium, without a window and without a network."""

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from selenium.webdriver import Chrome, ChromeOptions, ChromeService
from selenium.webdriver.remote.webelement import WebElement

FLAGS = (
    "--headless=new",
    "--no-sandbox",  # tests may run as root, in a container
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1200,1400",
)


CONTRAST = """
const light = (text) => {
  const [r, g, b] = text.match(/[\\d.]+/g).map(Number).map((v) => v / 255)
    .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const paper = light(getComputedStyle(document.body).backgroundColor);
const texts = "p, li, h1, h2, h3, td, th, a, summary, strong, .quiet, .missing, [data-plays]";
return [...document.querySelectorAll(texts)]
  .map((part) => light(getComputedStyle(part).color))
  .map((ink) => (Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05));
"""
"""The contrast of each text with the paper, as WCAG 2 computes it."""


@contextmanager
def chromium(profile: Path) -> Iterator[Chrome]:
    """An open browser that keeps what it logs and asks for; ``profile`` is an empty folder."""
    options = ChromeOptions()
    options.binary_location = str(shutil.which("chromium"))
    for flag in (*FLAGS, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    # The driver's path is given, so that selenium looks for none in the network.
    browser = Chrome(options, ChromeService(shutil.which("chromedriver")))
    try:
        yield browser
    finally:
        browser.quit()


def complaints(browser: Chrome) -> list[str]:
    """The errors that the page has logged since the last call."""
    return [
        str(entry["message"])
        for entry in _log(browser, "browser")
        if entry["level"] in ("SEVERE", "WARNING")
    ]


def requests(browser: Chrome) -> list[str]:
    """The addresses that the page now open, itself included, has asked for; not what it holds."""
    events = (json.loads(entry["message"])["message"] for entry in _log(browser, "performance"))
    asked = (e["params"] for e in events if e["method"] == "Network.requestWillBeSent")
    urls = [
        request["request"]["url"]
        for request in asked
        if request["documentURL"] == browser.current_url
    ]
    return [url for url in urls if not url.startswith("data:")]


def find_map(browser: Chrome, name: str) -> tuple[WebElement, list[WebElement], WebElement]:
    """A map of a report, its marks, and the player below it."""
    chooser = browser.find_element("css selector", f'[data-map="{name}"]')
    marks = chooser.find_elements("css selector", '[role="radio"]')
    return chooser, marks, browser.find_element("css selector", f'[data-player="{name}"]')


def press(browser: Chrome, mark: WebElement) -> None:
    """Click on an element in the middle of the screen."""
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", mark)
    mark.click()


def emulate(browser: Chrome, width: int, scheme: str) -> None:
    """Show the page on a screen of a width, light or dark, and wait until it is laid out."""
    screen = {"height": 1400, "deviceScaleFactor": 1, "mobile": False, "width": width}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
    media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    browser.execute_async_script(
        "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(done));"
    )


def _log(browser: Chrome, name: str) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = browser.get_log(name)  # type: ignore[no-untyped-call]
    return entries
