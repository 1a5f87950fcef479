"""The page reference.md: every group, choice and key of conf/, from the files and their comments.

A comment says what a key means on its line, or on the lines above it at its indentation. The
comments that begin a file describe its choice.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import yaml

from evoros.files.plugins import conf_folders
from generate import markdown

INTRODUCTION = """# Reference

Every group, choice and key of the [configuration](configuration.md), from the files in `conf/`.
Keys are relative to their group: `mount.z_m` under `robot=erle_rover` is `robot.mount.z_m` on the
command line. If the default of a key is a choice of a group, change it as a choice
(`controller/navigation=l1`, `filter@failure.effect=stuck`). Units are in brackets.
"""


class Key(NamedTuple):
    """A key of a file: its dotted name, its default as the file has it, and its meaning."""

    name: str
    default: str
    meaning: str


def write_page() -> str:
    """Write the text of the page: the top levels, then every group in the order of config.yaml."""
    core, *others = conf_folders()
    top = [core / "config.yaml", core / "evaluate.yaml"]
    sections = ["## Top level", *(_describe_file(path, path.stem) for path in top)]
    groups: dict[str, list[Path]] = {}
    for conf in (core, *others):
        for path in conf.rglob("*/*.yaml"):
            groups.setdefault(path.parent.relative_to(conf).as_posix(), []).append(path)
    for group, files in sorted(groups.items()):
        sections.append(f"## {group}")
        files = sorted(files, key=lambda file: file.stem)
        sections += [_describe_file(path, f"{group}={path.stem}") for path in files]
    return markdown.page([INTRODUCTION.rstrip(), *sections])


def _describe_file(path: Path, title: str) -> str:
    lines = path.read_text().splitlines()
    root = yaml.compose(path.read_text())
    header = []
    for line in lines:
        if not line.startswith("#"):
            break
        header += [] if line.startswith("# @") else [line.removeprefix("#").strip()]
    parts = [f"### `{title}`", markdown.link(" ".join(header))]
    keys = [*_list_defaults(root, lines), *_list_keys(root, lines, "")]
    if keys:
        rows = [
            (markdown.code(key.name), markdown.code(key.default), markdown.link(key.meaning))
            for key in keys
        ]
        parts.append(markdown.table(("key", "default", "meaning"), rows))
    return markdown.join(parts)


def _list_defaults(root: yaml.Node | None, lines: list[str]) -> Iterator[Key]:
    """List the groups that the defaults of a file choose, by the keys where they are placed."""
    for entry in _items(root).get("defaults", (None, yaml.SequenceNode("", [])))[1].value:
        if isinstance(entry, yaml.MappingNode):
            ((place, choice),) = entry.value
            group, _, key = place.value.removeprefix("override ").rpartition("@")
            name = (key or place.value.removeprefix("override ")).lstrip("/")
            meaning = _read_comment(lines, place.start_mark.line, 0)
            about = f"a choice of `{(group or name).lstrip('/')}`"
            yield Key(name.removeprefix("_global_."), choice.value, _join(about, meaning))


def _list_keys(node: yaml.Node | None, lines: list[str], prefix: str) -> Iterator[Key]:
    for name, (key, value) in _items(node).items():
        if name in ("_target_", "defaults"):
            continue
        meaning = _read_comment(lines, key.start_mark.line, key.start_mark.column)
        if isinstance(value, yaml.MappingNode) and value.value and not value.flow_style:
            if meaning:
                yield Key(prefix + name, "", meaning)
            yield from _list_keys(value, lines, f"{prefix}{name}.")
        else:
            yield Key(prefix + name, _source(value, lines), meaning)


def _items(node: yaml.Node | None) -> dict[str, tuple[yaml.Node, yaml.Node]]:
    pairs = node.value if isinstance(node, yaml.MappingNode) else []
    return {key.value: (key, value) for key, value in pairs}


def _read_comment(lines: list[str], index: int, column: int) -> str:
    """Read the comment of the key on a line: those above it, then the one at its end."""
    above: list[str] = []
    start = index
    while start and re.match(rf" {{{column}}}#", lines[start - 1]):
        start -= 1
    if start and any(line.strip() and not line.startswith("#") for line in lines[:start]):
        above = [line.strip().removeprefix("#").strip() for line in lines[start:index]]
    inline = re.search(r"\s#\s+(.*)$", lines[index])
    return " ".join([*above, inline[1] if inline else ""]).strip()


def _source(node: yaml.Node, lines: list[str]) -> str:
    """The text of a value as the file has it; a block of text is left out."""
    if isinstance(node, yaml.SequenceNode) and not node.flow_style:
        return f"[{', '.join(_source(item, lines) for item in node.value)}]"
    start, end = node.start_mark, node.end_mark
    if start.line == end.line:
        return re.sub(r"_target_: [\w.]+, ", "", lines[start.line][start.column : end.column])
    if isinstance(node, yaml.ScalarNode):
        return ""
    text = [lines[start.line][start.column :], *lines[start.line + 1 : end.line + 1]]
    text[-1] = text[-1][: end.column]
    return re.sub(r"\s+", " ", " ".join(text)).strip()


def _join(first: str, second: str) -> str:
    return f"{first}: {second}" if second else first
