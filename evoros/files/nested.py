"""Reads untrusted JSON and YAML, with limits on nesting and expansion."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from evoros.files.disk import SMALL, read_regular

DEPTH = 100  # maximum nesting depth of objects and lists
EXPANDED = 10**7  # maximum total length [characters] of all values with resolved references
_IN_C: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # None in some builds of PyYAML
_BYTE = re.compile(r"\\uDC[89A-F]", re.IGNORECASE)  # non-UTF-8 byte; the C loader rejects it
_REFERENCE = re.compile(r"\$\{(\.*)([^{}:]+)\}")


def parse_json(content: bytes | str) -> Any:
    """Parse JSON; raise a ValueError if it is malformed or nested too deeply."""
    try:
        value = json.loads(content)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    level = [value] if isinstance(value, dict | list) else []
    for _ in range(DEPTH):
        nodes = (node.values() if isinstance(node, dict) else node for node in level)
        level = [value for inner in nodes for value in inner if isinstance(value, dict | list)]
        if not level:
            return value
    raise ValueError("it is nested too deeply")


def read_yaml(path: Path) -> tuple[Any, str]:
    """Read a YAML file of at most ``SMALL`` bytes; return its tree and its text."""
    text = read_regular(path, SMALL).decode()
    return parse_yaml(text), text


def parse_yaml(text: str) -> Any:
    """Parse YAML without resolving references; raise a ValueError if it is malformed or unsafe."""
    loader = yaml.SafeLoader if _BYTE.search(text) else _IN_C
    try:
        _check_events(text, loader)
        tree = yaml.load(text, Loader=loader)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from error
    _check_references(tree)
    return tree


def _check_events(text: str, loader: Any) -> None:
    """Require limited nesting, and no aliases, because these can expand without limit."""
    depth = 0
    for event in yaml.parse(text, Loader=loader):
        if isinstance(event, yaml.AliasEvent):
            raise ValueError(f"*{event.anchor} is an alias; write out its value")
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > DEPTH:
            raise ValueError("it is nested too deeply")


def _check_references(tree: Any) -> None:
    """Require that references expand to at most ``EXPANDED`` characters in total."""
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
                raise ValueError(f"the references in {'.'.join(path)} expand without limit")
        return known[path]

    def targets(path: tuple[str, ...], text: str) -> Iterator[tuple[tuple[str, ...], Any]]:
        for dots, name in _REFERENCE.findall(text):
            above = path[: len(path) - len(dots)] if dots else ()
            target = (*above, *re.findall(r"[^.\[\]]+", name))
            yield target, _find(tree, target)

    try:
        measure((), tree)
    except RecursionError:
        raise ValueError("a chain of references is too long") from None


def _find(node: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        if isinstance(node, list) and name.isdecimal() and int(name) < len(node):
            node = node[int(name)]
        elif isinstance(node, dict):
            node = node.get(name)
        else:
            return None
    return node
