"""The classes that a configuration may name, of evoros and of the user's own folders.

A file of somebody else may name anything that Python can import and call.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

from hydra.utils import get_object

from evoros.base.errors import InputError
from evoros.config.messages import describe_build_error
from evoros.files.resources import bundled_folder

TARGET = "_target_"
OWN = "evoros"
ROOMS = (
    "allocation",
    "certificate",
    "controller",
    "design",
    "drive",
    "evolution",
    "executor",
    "failure",
    "field",
    "filter",
    "fitness",
    "measure",
    "observers",
    "optimizer",
    "requirement",
    "robot",
    "sensor",
    "simulator",
    "world",
)
"""Rooms of evoros whose classes describe parts: to build one has no effect."""


def check_targets(
    values: Mapping[str, Any], folders: Sequence[Path], where: Path | None = None
) -> tuple[str, ...]:
    """Require that each class which a configuration names is of evoros or of one of the folders.

    Modules of the folders are imported, others not. Returns the names of the classes. ``where`` is
    the file of the configuration, if it was not typed.
    """
    named = dict(_list_targets(values, ""))
    for key, target in named.items():
        problem = _find_problem(target, folders)
        if problem:
            place = key if where is None else f"{where}: {key}"
            raise InputError(f"{place}: {problem}")
    return tuple(dict.fromkeys(named.values()))


def _list_targets(node: Any, key: str) -> Iterator[tuple[str, Any]]:
    if isinstance(node, Mapping):
        for name, value in node.items():
            inner = f"{key}.{name}" if key else str(name)
            if name == TARGET:
                yield inner, value
            else:
                yield from _list_targets(value, inner)
    elif isinstance(node, list | tuple):
        for index, value in enumerate(node):
            yield from _list_targets(value, f"{key}[{index}]")


def _find_problem(target: Any, folders: Sequence[Path]) -> str:
    """Return why a class may not be built, or nothing."""
    if not isinstance(target, str):
        return f"must be the name of a class, not {target!r}; correct it"
    first = target.partition(".")[0]
    if first != OWN and not _is_in(first, folders):
        return (
            f"must be a class of evoros or of a folder that you name, not {target}, because "
            f"building it runs its code; if you trust it, add --config-dir with the folder of "
            f"its module {first}"
        )
    try:
        named = get_object(target)
    except Exception as error:  # a user's module raises anything while it is imported
        return describe_build_error(error)
    package, room = (*str(getattr(named, "__module__", "")).split("."), "")[:2]
    if package == OWN:
        is_part = isinstance(named, type) and room in ROOMS
    else:
        is_part = first != OWN and _is_in(package, folders)
    if is_part or target in _list_bundled():
        return ""
    return f"must be a class of a part, not {target}; correct it"


def _is_in(module: str, folders: Sequence[Path]) -> bool:
    """Whether Python would import a module from one of the folders."""
    spec = PathFinder.find_spec(module) if module else None
    origins = [spec.origin, *(spec.submodule_search_locations or ())] if spec else []
    paths = [Path(origin).resolve() for origin in origins if origin]
    return any(path.is_relative_to(folder) for path in paths for folder in folders)


@cache
def _list_bundled() -> frozenset[str]:
    """List what the files of conf/ name."""
    texts = (file.read_text(encoding="utf-8") for file in bundled_folder("conf").rglob("*.yaml"))
    pattern = rf"{TARGET}: *([\w.]+)"
    return frozenset(name for text in texts for name in re.findall(pattern, text))
