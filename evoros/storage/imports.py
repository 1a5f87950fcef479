"""What the modules of a user's own parts import: packages, and further modules of the user's.

Sources are read and not run, so that imports inside functions count, too.
"""

import ast
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from importlib.machinery import ModuleSpec
from importlib.metadata import packages_distributions
from importlib.util import find_spec
from pathlib import Path

OWN = "evoros"


@dataclass
class Imports:
    """``packages`` are names of distributions; ``modules`` has the file of each module."""

    packages: set[str] = field(default_factory=set)
    modules: dict[str, Path] = field(default_factory=dict)


def collect_imports(modules: Iterable[str]) -> Imports:
    """Collect what modules import, directly and through further modules that are no package's.

    A module of evoros, of Python itself, or one that cannot be found is left out.
    """
    found = Imports()
    pending = list(modules)
    seen: set[str] = set()
    while pending:
        name = pending.pop()
        if name in seen or name.partition(".")[0] in (OWN, *sys.stdlib_module_names):
            continue
        seen.add(name)
        distributions = _list_distributions(name.partition(".")[0])
        if distributions:
            found.packages.update(distributions)
            continue
        spec = _find_spec(name)
        if spec is None or not spec.origin or not Path(spec.origin).is_file():
            continue
        found.modules[name] = Path(spec.origin)
        pending += _list_imported(spec, Path(spec.origin))
    return found


def _list_distributions(top: str) -> list[str]:
    """List the installed packages that a name at the top of Python's names belongs to."""
    return sorted(set(_map_distributions().get(top, ())))


@cache
def _map_distributions() -> dict[str, list[str]]:
    return {top: list(names) for top, names in packages_distributions().items()}


def _find_spec(name: str) -> ModuleSpec | None:
    """Find a module without running it, unless it is in a package, which finding imports."""
    try:
        return find_spec(name)
    except Exception:  # a package of the user's raises anything while it is imported
        return None


def _list_imported(spec: ModuleSpec, file: Path) -> Iterator[str]:
    """Yield the names of all modules that a module may import, with those that are no modules."""
    if file.suffix != ".py":
        return
    package = spec.name if spec.submodule_search_locations else spec.parent or ""
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError):  # it is not of this Python; whoever imports it says so
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = _resolve(node, package)
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names if alias.name != "*")


def _resolve(node: ast.ImportFrom, package: str) -> str:
    """Return the absolute name of the module behind ``from``."""
    if not node.level:
        return node.module or ""
    parents = package.split(".")
    above = ".".join(parents[: len(parents) - node.level + 1])
    return f"{above}.{node.module}" if node.module else above
