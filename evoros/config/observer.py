"""Builds an observer by its name, apart from any run."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.config.configuration import build
from evoros.observers.protocol import Observer

GROUP = "observers"


def build_observer(name: str, overrides: Sequence[str], config_dir: str | Path | None) -> Observer:
    """Build the choice of a name of the group, with ``overrides`` of its own keys.

    Raises:
        InputError: there is none of this name, or a key or value cannot be used.
    """
    typed = [f"{GROUP}.{name}.{text}" for text in overrides]
    config = compose([f"{GROUP}={name}", *typed], config_dir=config_dir)
    built: dict[str, Any] = build(config.values[GROUP], config.choices)
    if not isinstance(built.get(name), Observer):
        raise InputError(
            f"{GROUP}/{name}.yaml: must have the key {name} with the class of an observer, not "
            f"{', '.join(built) or 'nothing'}; choose another tracker, or correct the file"
        )
    observer: Observer = built[name]
    return observer
