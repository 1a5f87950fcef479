"""Reads the documents, which tests compare with the code."""

import re
import shlex
from collections.abc import Mapping
from pathlib import Path

from helpers import ROOT

from evoros.cli.subcommands import SUBCOMMANDS

DOCS = ROOT / "docs"
PARTS = sorted(f"parts/{page.stem}" for page in (DOCS / "parts").glob("*.md"))
"""The pages with an example of each kind of part."""


def page(name: str) -> Path:
    """The file of a page: of docs/, otherwise the plug-in's."""
    file = DOCS / f"{name}.md"
    return file if file.exists() else ROOT / "evoros" / "plugins" / name / "README.md"


def text(name: str) -> str:
    return page(name).read_text()


def figure_pages() -> str:
    """The pages that describe the figures: the core's, then each plug-in's."""
    files = [page("analysis"), *sorted(ROOT.glob("evoros/plugins/*/README.md"))]
    return "\n".join(file.read_text() for file in files)


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


def columns(content: str, file: str) -> list[list[str]]:
    """The columns of a file of results and their meanings: a list below its name, or a table."""
    lists = re.findall(rf"^`{re.escape(file)}`?[^`\n]*:\n\n((?:[- ] .*\n)+)", content, re.M)
    items = re.findall(r"^- ((?:`\w+`(?:,\s+)?)+)(?::\s+(.*(?:\n  .*)*))?$", "".join(lists), re.M)
    listed = [[names.strip("`"), " ".join(meaning.split())] for names, meaning in items]
    return listed or table(content, f"column of `{file}")


def files(name: str) -> dict[str, str]:
    """The files that a document spells out: a line with a path, then a block of code."""
    blocks = re.findall(
        r"^`((?:mine|theirs)/[\w./]+)`:\n\n```\w+\n(.*?)^```$", text(name), re.M | re.S
    )
    return dict(blocks)


def example_files() -> dict[str, str]:
    """The robot and the world that docs/your_robot.md copies, by their paths in its folder."""
    examples = DOCS / "examples"
    paths = sorted(path for path in (examples / "theirs").rglob("*") if path.is_file())
    return {str(path.relative_to(examples)): path.read_text() for path in paths}


def part_files() -> dict[str, str]:
    """The files of the examples of all parts."""
    return {path: content for page in PARTS for path, content in files(page).items()}


def write(contents: Mapping[str, str], folder: Path) -> None:
    for path, content in contents.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(content)


def code(name: str) -> list[str]:
    """The blocks of Python of a document that are no files."""
    content = re.sub(r"^`mine/[\w./]+`:\n\n```python\n.*?^```$", "", text(name), flags=re.M | re.S)
    return re.findall(r"^```python\n(.*?)^```$", content, re.M | re.S)


def shell_blocks(content: str) -> list[str]:
    return re.findall(r"^```bash\n(.*?)^```$", content, re.M | re.S)


def shell_lines(content: str) -> list[str]:
    return [line for block in shell_blocks(content) for line in block.splitlines()]


def commands(name: str) -> list[str]:
    """The lines that call evoros."""
    return [line for line in shell_lines(text(name)) if line.startswith("evoros ")]


def split_command(line: str) -> list[str]:
    """The words of a command line; a subcommand is one word with ``evoros``."""
    name, *words = shlex.split(line, comments=True)
    if name == "evoros" and words and words[0] in SUBCOMMANDS:
        return [f"evoros {words[0]}", *words[1:]]
    return [name, *words]


def documented(heading: str) -> list[str]:
    """The columns of the tables of one section of run_folder.md, in order."""
    content = re.split(r"^## ", text("run_folder"), flags=re.M)
    (section,) = (part for part in content if part.startswith(heading + "\n"))
    rows = [row[0] for first in ("column", "field") for row in table(section, first)]
    return [name for row in rows for name in re.findall(r"[\w.]+", row)]
