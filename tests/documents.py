"""Reads the documents, which tests compare with the code."""

import re
from collections.abc import Mapping
from pathlib import Path

from helpers import ROOT

DOCS = ROOT / "docs"


def text(name: str) -> str:
    return (DOCS / f"{name}.md").read_text()


def table(content: str, first: str) -> list[list[str]]:
    """The cells of all rows of the tables whose first heading is ``first``, backticks removed."""
    rows, inside = [], False
    for line in content.splitlines():
        # A | inside backticks would split a cell; the documents have none.
        cells = [cell.strip().strip("`") for cell in line.strip("|").split("|")]
        if not line.startswith("|"):
            inside = False
        elif not inside:
            inside = cells[0] == first
        elif not set(line) <= set("|-"):
            rows.append(cells)
    return rows


def files(name: str) -> dict[str, str]:
    """The files that a document spells out: a line with a path, then a block of code."""
    blocks = re.findall(
        r"^`((?:mine|theirs)/[\w./]+)`:\n\n```\w+\n(.*?)^```$", text(name), re.M | re.S
    )
    return dict(blocks)


def write(contents: Mapping[str, str], folder: Path) -> None:
    for path, content in contents.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(content)


def code(name: str) -> list[str]:
    """The blocks of Python of a document that are no files."""
    content = re.sub(r"^`mine/[\w./]+`:\n\n```python\n.*?^```$", "", text(name), flags=re.M | re.S)
    return re.findall(r"^```python\n(.*?)^```$", content, re.M | re.S)


def commands(name: str) -> list[str]:
    """The lines that call evoros."""
    blocks = re.findall(r"^```bash\n(.*?)^```$", text(name), re.M | re.S)
    return [line for block in blocks for line in block.splitlines() if line.startswith("evoros ")]


def documented(heading: str) -> list[str]:
    """The columns of the tables of one section of run_folder.md, in order."""
    content = re.split(r"^## ", text("run_folder"), flags=re.M)
    (section,) = (part for part in content if part.startswith(heading + "\n"))
    return [row[0] for first in ("column", "field") for row in table(section, first)]
