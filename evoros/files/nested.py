"""Reads JSON and YAML of others: what is nested too deep, or grows as it is read, is refused."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from evoros.files.regular import SMALL, read_regular

DEPTH = 100
"""The maximum number of objects and lists in each other."""
EXPANDED = 10**7
"""The maximum length of all values once references in them are resolved [characters]."""
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # in C, if this PyYAML has it
_REFERENCE = re.compile(r"\$\{(\.*)([^{}:]+)\}")


def parse_json(content: bytes | str) -> Any:
    """Parse JSON.

    Raises:
        ValueError: it is no JSON, or is nested too deep.
    """
    try:
        value = json.loads(content)
    except RecursionError:
        raise ValueError("it is nested too deep") from None
    level = [value]
    for _ in range(DEPTH):
        level = [inner for node in level for inner in _list_inner(node)]
        if not level:
            return value
    raise ValueError("it is nested too deep")


def _list_inner(node: Any) -> list[Any]:
    inner = node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    return [value for value in inner if isinstance(value, dict | list)]


def read_yaml(path: Path) -> tuple[Any, str]:
    """Read the YAML and the text of a small file such as a recorded configuration.

    Raises:
        OSError: the file cannot be read, or is too large.
        ValueError: it is no YAML of this kind.
    """
    text = read_regular(path, SMALL).decode()
    return parse_yaml(text), text


def parse_yaml(text: str) -> Any:
    """Parse YAML. Its references ``${...}`` stay as they are.

    Raises:
        ValueError: it is no YAML of this kind.
    """
    try:
        _check_events(text)
        tree = yaml.load(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from error
    _check_references(tree)
    return tree


def _check_events(text: str) -> None:
    """Require few levels, and no alias: a short text of aliases may stand for any amount."""
    depth = 0
    for event in yaml.parse(text, Loader=_LOADER):
        if isinstance(event, yaml.AliasEvent):
            raise ValueError(f"*{event.anchor} must be written out, and not be an alias")
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > DEPTH:
            raise ValueError("it is nested too deep")


def _check_references(tree: Any) -> None:
    """Require that references, which may lead to further ones, do not multiply.

    A reference to itself counts as short; who resolves it reports that.
    """
    known: dict[tuple[str, ...], int] = {}

    def measure(path: tuple[str, ...], node: Any) -> int:
        if path not in known:
            known[path] = 1
            if isinstance(node, dict | list):
                items = node.items() if isinstance(node, dict) else enumerate(node)
                known[path] = 1 + sum(measure((*path, str(key)), value) for key, value in items)
            elif isinstance(node, str):
                known[path] = len(node) + sum(measure(*target) for target in targets(path, node))
            if known[path] > EXPANDED:
                raise ValueError(f"the references of {'.'.join(path)} multiply without end")
        return known[path]

    def targets(path: tuple[str, ...], text: str) -> Iterator[tuple[tuple[str, ...], Any]]:
        for dots, name in _REFERENCE.findall(text):
            above = path[: len(path) - len(dots)] if dots else ()
            target = (*above, *re.findall(r"[^.\[\]]+", name))
            yield target, _find(tree, target)

    try:
        measure((), tree)
    except RecursionError:
        raise ValueError("its references lead too far") from None


def _find(node: Any, path: tuple[str, ...]) -> Any:
    """Return the value at a path; None if there is none."""
    for name in path:
        if isinstance(node, list) and name.isdecimal() and int(name) < len(node):
            node = node[int(name)]
        elif isinstance(node, dict):
            node = node.get(name)
        else:
            return None
    return node
