"""The tutorial's commands run as they are written, except for the size of the study."""

import json
import re
import runpy
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nbformat
import pytest
from documents import shell_lines, split_command
from helpers import ROOT
from nbclient import NotebookClient

from evoros.analysis.command import evoros_analyze
from evoros.analysis.subcommands import EXPORTS, SUBCOMMANDS
from evoros.cli.command import evaluate
from evoros.cli.main import evoros
from evoros.terminal.console import DONE

pytestmark = pytest.mark.slow

TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text()
COMMANDS: dict[str, Callable[[list[str]], int]] = {
    "evoros": evoros,
    "evoros evaluate": evaluate,
    "evoros analyze": evoros_analyze,
}
SHORT = ["course.time_limit_s=25", "executor=serial"]
SMALL = {
    "evoros": [
        *SHORT,
        "seed=0",
        "figures=[]",
        "optimizer.population_size=3",
        "optimizer.generations=2",
        "optimizer.validation_trials=1",
    ],
    "evoros evaluate": [*SHORT, "trials=1"],
}
CLIP = ["--to", "2", "--size", "160x90"]


def lines() -> list[list[str]]:
    typed = map(split_command, shell_lines(TUTORIAL))
    return [words for words in typed if words[0] in COMMANDS]


def smaller(words: list[str]) -> list[str]:
    """The arguments, with those of the smaller study in place of the same keys."""
    name, *arguments = words
    added = CLIP if arguments[0] == "video" else SMALL.get(name, [])
    if "experiment=coevolution" in arguments and name == "evoros":
        added = ["seed=0,1" if word == "seed=0" else word for word in added]  # to compare
    keys = {word.partition("=")[0] for word in added if "=" in word}
    return [*(word for word in arguments if word.partition("=")[0] not in keys), *added]


ELSEWHERE = {"controls", "regression", "requirements"}
"""Subcommands that docs/evaluation.md and docs/test_bench.md show."""


def shorten(line: str) -> str:
    words = split_command(line)
    return f"{words[0]} {shlex.join(smaller(words))}"


def test_every_command_runs_in_order_and_leaves_what_the_next_needs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    used: set[str] = set()
    for words in lines():
        if words[1] == "report" and "report" in used:
            continue  # all of its figures are drawn by other commands
        used.add(words[1])
        assert COMMANDS[words[0]](smaller(words)) == DONE, (words, capsys.readouterr().err)
    used &= set(SUBCOMMANDS)
    assert used - EXPORTS == set(SUBCOMMANDS) - EXPORTS - ELSEWHERE
    folders = [tmp_path / "outputs" / name for name in ("paper", "network_paper")]
    drawn = {path.stem for folder in folders for path in folder.iterdir()}
    assert drawn >= used - EXPORTS
    assert "Traceback" not in capsys.readouterr().err


def build_notebook() -> Any:
    """The notebook of the tutorial, made by its script."""
    script = runpy.run_path(str(ROOT / "docs" / "notebook.py"))
    content = json.dumps(script["build_notebook"]())
    return nbformat.reads(content, as_version=4)  # type: ignore[no-untyped-call]


def test_the_notebook_has_all_of_the_page() -> None:
    notebook = build_notebook()
    nbformat.validate(notebook)
    sources = [cell.source for cell in notebook.cells]
    typed = [line for source in sources for line in source.splitlines()]
    assert [split_command(line) for line in typed if line.startswith("evoros ")] == lines()
    headings = re.findall(r"^#+ .*$", TUTORIAL, re.M)
    assert [line for line in typed if re.match("#+ [^T]", line)] == headings[1:]
    pictures = [name for cell in notebook.cells for name in cell.get("attachments", {})]
    assert pictures == re.findall(r"\(img/([\w.]+)\)", TUTORIAL)


def test_the_notebook_runs(tmp_path: Path) -> None:
    """The first section, with one run of the study; the others run above, by command."""
    notebook = build_notebook()
    second = next(i for i, cell in enumerate(notebook.cells) if "## 2." in cell.source)
    notebook.cells = notebook.cells[:second]
    for cell in notebook.cells:
        if cell.cell_type == "code" and cell.source.startswith("%%bash"):
            first, *typed = cell.source.splitlines()
            short = [shorten(line) for line in typed]
            one = "\n".join([first, *short]).replace("seed=0,1", "seed=0")
            cell.source = one.replace("optimizer=ga,random_search", "optimizer=ga")
    resources = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=280, kernel_name="python3", resources=resources).execute()
    assert len(list(tmp_path.glob("outputs/network/*/champion/design.csv"))) == 1
