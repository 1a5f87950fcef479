"""Imports of the modules of a user's own parts: packages, and further modules of the user's.

Sources are read and not run, so that imports inside functions count, too.
"""

import ast
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from importlib.machinery import ModuleSpec
from importlib.metadata import packages_distributions
from importlib.util import find_spec, resolve_name
from pathlib import Path

OWN = "evoros"
_map_distributions = cache(packages_distributions)


@dataclass
class Imports:
    """``packages`` are names of distributions; ``modules`` has the file of each module."""

    packages: set[str] = field(default_factory=set)
    modules: dict[str, Path] = field(default_factory=dict)


def collect_imports(modules: Iterable[str]) -> Imports:
    """Collect the imports of modules, directly and through further modules that are no package's.

    A module of evoros, of Python itself, or one that cannot be found is left out.
    """
    imports = Imports()
    pending = list(modules)
    seen: set[str] = set()
    while pending:
        name = pending.pop()
        top = name.partition(".")[0]
        if name in seen or top in (OWN, *sys.stdlib_module_names):
            continue
        seen.add(name)
        distributions = _map_distributions().get(top)
        if distributions:
            imports.packages.update(distributions)
            continue
        spec = _find_spec(name)
        if spec is None or not spec.origin or not Path(spec.origin).is_file():
            continue
        imports.modules[name] = Path(spec.origin)
        pending += _list_imported(spec, Path(spec.origin))
    return imports


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
    package = spec.name if spec.submodule_search_locations else spec.parent
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError):  # it is not of this Python, which its importer reports
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            try:
                base = resolve_name(f"{'.' * node.level}{node.module or ''}", package)
            except ImportError:  # beyond the top of its package
                continue
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names if alias.name != "*")
