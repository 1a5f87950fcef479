"""Speeds up start-up: imports modules on first use, and collects garbage less often."""

from __future__ import annotations

import gc
from importlib import import_module

TYPE_CHECKING = False  # constant, because importing typing takes longer than this module
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any


def import_lazily(
    package: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` for a package; ``homes`` maps names to modules."""

    def get_name(name: str) -> Any:
        if name in homes:
            return getattr(import_module(f"{package}.{homes[name]}"), name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    def list_names() -> list[str]:
        return sorted(homes)

    return get_name, list_names


def collect_rarely() -> None:
    """Collect garbage less often; with Python's default, runs take 5 % longer to start."""
    gc.set_threshold(50_000, 20, 20)
