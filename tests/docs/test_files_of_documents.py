"""Links lead to a file and its heading, pictures are small, and files of a release agree."""

import io
import re
import subprocess
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pytest
import yaml
from documents import DOCS, shell_blocks, text
from helpers import ROOT
from PIL import Image

from evoros.analysis.drawing.style import VISIBLE, save_png

PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(DOCS.rglob("*.md"))]
PAGES += sorted(ROOT.glob("evoros/plugins/*/README.md"))


def prose(page: Path) -> str:
    """The text without its blocks of code."""
    return re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S)


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub forms them."""
    headings = re.findall(r"^#+ (.*)$", prose(page), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def links(page: Path) -> list[str]:
    targets = re.findall(r"\]\(([^)\s]+)\)", prose(page))
    return [target for target in targets if not target.startswith(("http", "mailto"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page: Path) -> None:
    for link in links(page):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_table_has_no_gap(page: Path) -> None:
    rest = re.findall(r"\|\n\n+(\|.*)\n(?!\|[-| :]+\|$)", prose(page), re.M)
    assert rest == []


def test_the_citation_names_whom_the_licence_names_and_no_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    holder = re.search(r"Copyright \(c\) \d+ (.*)", (ROOT / "LICENSE").read_text())
    assert holder
    assert [author["name"] for author in citation["authors"]] == [holder[1]]
    assert citation["cff-version"] == "1.2.0"
    assert "version" not in citation  # it is the tag of git, and nothing else states it
    assert {"authors", "message", "title"} <= set(citation)
    (paper,) = citation["references"]
    assert paper["year"] == 2018
    assert paper["title"].startswith("Evo-ROS")


def test_nothing_states_a_version() -> None:
    project = (ROOT / "pyproject.toml").read_text()
    assert re.search(r"^version\s*=", project, re.M) is None
    assert 'dynamic = ["version"]' in project


def test_the_site_lists_every_page() -> None:
    entries = re.findall(r"^   (?:\w+ <)?/?([\w/]+\*?)>?$", (DOCS / "index.rst").read_text(), re.M)
    pages = {str(page.relative_to(DOCS).with_suffix("")) for page in DOCS.rglob("*.md")}
    listed = {page for page in pages for entry in entries if fnmatch(page, entry)}
    assert listed == pages
    assert {"README", "CHANGELOG"} <= set(entries)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_shell_takes_every_line(page: Path) -> None:
    for block in shell_blocks(page.read_text()):
        checked = subprocess.run(["bash", "-n"], input=block, capture_output=True, text=True)
        assert checked.stderr == ""


@pytest.mark.parametrize(("name", "number"), [("tutorial", 6), ("your_robot", 2)])
def test_pictures_of_a_guide_are_fit_to_print(name: str, number: int) -> None:
    pictures = re.findall(r"!\[[^\]]+\]\((img/[\w.]+)\)", text(name))
    assert len(pictures) >= number
    for picture in pictures:
        with Image.open(DOCS / picture) as image:
            assert image.width >= 1000  # pixels: of at least one column at 300 dots an inch


def test_the_pictures_are_small() -> None:
    assert sum(file.stat().st_size for file in (DOCS / "img").iterdir()) <= 3_000_000


def test_no_script_writes_pictures_by_itself() -> None:
    writers = {"analysis/drawing/style.py"}
    names = {
        str(file.relative_to(ROOT))
        for folder in ("analysis", "benchmarks", "docs")
        for file in (ROOT / folder).rglob("*.py")
        if ".savefig(" in file.read_text()
    }
    assert names == writers


def reread(picture: Image.Image) -> tuple[Image.Image, int]:
    file = io.BytesIO()
    save_png(picture, file)
    return Image.open(io.BytesIO(file.getvalue())), len(file.getvalue())


@pytest.mark.parametrize("seed", range(3))
def test_few_colours_become_a_palette_and_stay(seed: int) -> None:
    rng = np.random.default_rng(seed)
    colours = rng.integers(0, 256, (40, 3), dtype=np.uint8)
    pixels = np.kron(rng.integers(0, 40, (30, 20)), np.ones((8, 8), dtype=int))
    picture = Image.fromarray(colours[pixels])
    small, size = reread(picture)
    plain = io.BytesIO()
    picture.save(plain, "PNG")
    assert (small.mode, small.size) == ("P", picture.size)
    assert size < len(plain.getvalue())
    error = np.abs(np.asarray(small.convert("RGB"), dtype=int) - np.asarray(picture)).mean()
    assert error <= VISIBLE


def test_a_photograph_keeps_its_colours_and_transparency_its_own() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (60, 60, 4), dtype=np.uint8)
    for mode, picture in (
        ("RGB", Image.fromarray(pixels[..., :3].copy())),
        ("RGBA", Image.fromarray(pixels)),
    ):
        again, _ = reread(picture)
        assert again.mode == mode
        assert np.array_equal(np.asarray(again), np.asarray(picture))


def test_the_folder_has_nothing_else() -> None:
    kinds = {Path(file).suffix for file in (DOCS / "img").iterdir() if file.is_file()}
    assert kinds <= {".png", ".svg", ".py"}
