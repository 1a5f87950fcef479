"""The site of the documents: built strictly, whole, without the network, and for small screens."""

import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from browser import chromium
from helpers import ROOT

pytestmark = pytest.mark.slow

LOADED = {("link", "href"), ("script", "src"), ("img", "src")}


class Page(HTMLParser):
    """The anchors of a page, its links, and what it loads."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(file.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id" and value:
                self.ids.add(value)
            if (tag, name) == ("a", "href") and value:
                self.links.append(value)
            if (tag, name) in LOADED and value:
                self.loaded.append(value)


read = cache(Page)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    options = ["-W", "--keep-going", "-q", "-b", "html", "-d", str(folder / "trees")]
    command = [sys.executable, "-m", "sphinx", *options, "-c", "docs", ".", str(folder / "html")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return folder / "html"


def pages(site: Path) -> list[Path]:
    return sorted(file for file in site.rglob("*.html") if "_static" not in file.parts)


def test_every_page_is_there(site: Path) -> None:
    names = {file.relative_to(site).with_suffix(".md") for file in pages(site)}
    sources = [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CHANGELOG.md"]
    assert {source.relative_to(ROOT) for source in sources} <= names
    assert "docs/index.html" in (site / "index.html").read_text()


def inner(page: Path, target: str) -> Iterator[tuple[Path, str]]:
    parts = urlsplit(target)
    if not parts.scheme:
        path = unquote(parts.path)
        yield ((page.parent / path).resolve() if path else page, unquote(parts.fragment))


def test_every_link_and_anchor_leads_somewhere(site: Path) -> None:
    broken = [
        (page.name, link)
        for page in pages(site)
        for link in read(page).links
        for file, anchor in inner(page, link)
        if not file.exists() or (anchor and file.suffix == ".html" and anchor not in read(file).ids)
    ]
    assert broken == []


def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    for page in pages(site):
        for target in read(page).loaded:
            assert [file.exists() for file, _ in inner(page, target)] == [True], (page, target)


@pytest.mark.browser
def test_no_page_is_wider_than_a_small_screen(site: Path, tmp_path: Path) -> None:
    with chromium(tmp_path) as driver:
        size = {"width": 400, "height": 800, "deviceScaleFactor": 1, "mobile": True}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        for page in pages(site):
            driver.get(page.as_uri())
            width = driver.execute_script("return document.documentElement.scrollWidth")
            assert width <= 400, page
