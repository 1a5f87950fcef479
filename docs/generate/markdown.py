"""Markdown that the generated pages share."""

import re
import textwrap
from collections.abc import Iterable, Sequence
from itertools import groupby

WIDTH = 96
"""Characters in a line of code."""


def code(text: str) -> str:
    """Return a text in backticks; nothing stays nothing."""
    return f"`{text}`" if text else ""


def link(text: str) -> str:
    """Make links of the pages that a text names."""

    def name(match: re.Match[str]) -> str:
        page = match[1]
        return f"[{page.replace('_', ' ').capitalize()}]({page}.md)"

    def name_plugin(match: re.Match[str]) -> str:
        plugin = match[1]
        return f"[{plugin.capitalize()}](../evoros/plugins/{plugin}/README.md)"

    text = re.sub(r"`*plugins/(\w+)/README\.md`*", name_plugin, text)
    return re.sub(r"`*docs/(\w+)\.md`*", name, text)


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; bars in the cells are escaped."""
    head = f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}"
    lines = (" | ".join(cell.replace("|", r"\|") for cell in row) for row in rows)
    return "\n".join([head, *(f"| {line} |" for line in lines)])


def join(parts: Iterable[str]) -> str:
    """Join the parts of a page that are not empty by empty lines."""
    return "\n\n".join(part for part in parts if part)


def page(parts: Iterable[str]) -> str:
    """Return the text of a page."""
    return join(parts) + "\n"


def python(text: str) -> str:
    """Return a block of Python."""
    return f"```python\n{text}\n```"


def docstring(text: str) -> str:
    """Turn a docstring into Markdown: names, indented code, and the list of its errors."""
    body, _, raises = text.partition("\nRaises:\n")
    paragraphs = re.split(r"\n\s*\n", body.strip("\n"))
    return join([*_join_code(paragraphs), _list_errors(raises)])


def _join_code(paragraphs: Iterable[str]) -> Iterable[str]:
    """Yield prose and blocks of code; indented paragraphs that follow each other are one block."""
    for is_code, group in groupby(paragraphs, lambda paragraph: paragraph.startswith("    ")):
        if is_code:
            block = textwrap.dedent("\n\n".join(group))
            yield python(re.sub(r"\n\n(?=class |def |@)", "\n\n\n", block))  # as formatters want it
        else:
            yield from map(prose, group)


def prose(text: str) -> str:
    """Turn a paragraph of a docstring, or a comment, into Markdown."""
    return link(re.sub(r"::$", ":", text.strip()).replace("``", "`"))


def _list_errors(text: str) -> str:
    items = re.findall(r"^ {4}(\w+): (.*(?:\n {8}.*)*)", text, re.M)
    lines = [f"- `{name}`: {prose(' '.join(about.split()))}" for name, about in items]
    return "\n".join(["Raises:\n", *lines]) if lines else ""
