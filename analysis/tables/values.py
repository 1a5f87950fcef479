"""The values of a recorded configuration, by dotted key."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from evoros.base.errors import InputError

REFERENCE = re.compile(r"\$\{([\w.]+)\}")
"""What refers to another key. What refers to the environment is left as it is: it may be secret."""


def read_values(path: Path) -> dict[str, Any]:
    """All values of a ``config.yaml``, references to other keys followed. Lists are values.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        tree = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        said = " ".join(str(error).split())
        raise InputError(f"{path}: must be valid YAML ({said}); restore the file") from error
    if not isinstance(tree, dict):
        raise InputError(f"{path}: must be a mapping of keys to values; restore the file")
    return dict(_flat(tree, tree, ()))


def _flat(
    node: Mapping[str, Any], tree: Mapping[str, Any], above: tuple[str, ...]
) -> Iterator[tuple[str, Any]]:
    for key, value in node.items():
        path = (*above, str(key))
        found = _followed(value, tree)
        if isinstance(found, dict) and found and len(path) < 20:
            yield from _flat(found, tree, path)
        else:
            yield ".".join(path), found


def _followed(value: Any, tree: Mapping[str, Any]) -> Any:
    """What a value refers to, in the end; itself where that leads nowhere."""
    for _ in range(20):  # references in a circle end, too
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
