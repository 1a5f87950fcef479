"""The values of a recorded configuration, by dotted key."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError, single_line
from evoros.files.nested import read_yaml

REFERENCE = re.compile(r"\$\{([\w.]+)\}")
"""A reference to another key. References to the environment stay as text: they may be secret."""
_DEPTH = 20
"""Maximum length of a chain of references, so that circular references end, too."""


def read_values(path: Path) -> dict[str, Any]:
    """Read all values of a ``config.yaml``, lists as one, with its references resolved."""
    try:
        tree, _ = read_yaml(path)
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path}: must be valid YAML ({single_line(error)}); restore the file"
        ) from error
    if not isinstance(tree, dict):
        raise InputError(f"{path}: must be a mapping of keys to values; restore the file")
    return dict(_flatten(tree, tree, ()))


def format_value(value: object) -> str:
    """Format a value as in YAML."""
    if value is None:
        return "null"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _flatten(
    node: Mapping[str, Any], tree: Mapping[str, Any], parents: tuple[str, ...]
) -> Iterator[tuple[str, Any]]:
    for key, value in node.items():
        path = (*parents, str(key))
        resolved = _resolve(value, tree)
        if isinstance(resolved, dict) and resolved and len(path) < _DEPTH:
            yield from _flatten(resolved, tree, path)
        else:
            yield ".".join(path), resolved


def _resolve(value: Any, tree: Mapping[str, Any]) -> Any:
    """Follow references to the value they lead to; a broken reference stays as it is."""
    for _ in range(_DEPTH):
        match = REFERENCE.fullmatch(value) if isinstance(value, str) else None
        if match is None:
            return value
        node: Any = tree
        for name in match[1].split("."):
            if not isinstance(node, dict) or name not in node:
                return value
            node = node[name]
        value = node
    return value
