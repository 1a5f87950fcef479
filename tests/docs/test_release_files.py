"""The files that a release needs beside the code agree."""

import re
from fnmatch import fnmatch

import yaml
from documents import DOCS
from helpers import ROOT


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
