"""The pages that follow from the code: written from it, complete, and each name once."""

import argparse
import re
import sys
from importlib import import_module
from importlib.util import find_spec
from runpy import run_path

import pytest
from documents import DOCS, text
from fixture_types import Capture, Patch

from evoros.analysis.subcommands import SUBCOMMANDS, add_all_arguments, import_subcommand

PAGES = {
    "evoros": "api",
    "evoros.parts": "api_parts",
    "evoros.analysis": "api_analysis",
    "evoros.testing": "api_testing",
}


@pytest.mark.slow
def test_the_pages_are_written_from_the_code(monkeypatch: Patch, capsys: Capture) -> None:
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "argv", ["reference.py", "--check"])
    with pytest.raises(SystemExit, match=r"^0$"):
        run_path(str(DOCS / "reference.py"), run_name="__main__")
    told = capsys.readouterr()
    assert told.out + told.err == "", "run python docs/reference.py, and commit its pages"


@pytest.mark.parametrize("name", [name for name in PAGES if find_spec(name)])
def test_every_public_name_has_one_entry(name: str) -> None:
    module = import_module(name)
    headings = re.findall(r"^##+ (`\w+`(?:, `\w+`)*)$", text(PAGES[name]), re.M)
    listed = [entry for heading in headings for entry in re.findall(r"\w+", heading)]
    assert sorted(listed) == sorted(module.__all__)


@pytest.mark.parametrize("name", [name for name in PAGES if find_spec(name)])
def test_every_entry_describes_its_name(name: str) -> None:
    """A rule is described by its text, which is a part of its code."""
    parts = re.split(r"^##+ (?=`)", text(PAGES[name]), flags=re.M)[1:]
    for part in parts:
        heading, _, body = part.partition("\n")
        without_code = re.sub(r"```.*?```", "", body, flags=re.S).strip()
        assert without_code or re.search(r"= (Rule|\w+_of)\(", body), heading


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_every_option_of_a_figure_is_described(name: str) -> None:
    parser = argparse.ArgumentParser()
    add_all_arguments(parser, import_subcommand(name))
    options = set(re.findall(r"--[a-z-]+", parser.format_help())) - {"--help"}
    page = text("figures")
    common, own = (page.split(f"\n## {title}\n")[1] for title in ("Common options", name))
    described = common.split("\n## ")[0] + own.split("\n## ")[0]
    assert options <= set(re.findall(r"`(--[a-z-]+)", described)), name
