"""The command ``evoros``: evolves, or goes on with a run."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.command import DONE, INPUT, INTERRUPTED, STOPPED, Command

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from evoros.session import Work

__all__ = ["DONE", "INPUT", "INTERRUPTED", "STOPPED", "evoros", "main"]


def main() -> None:
    """Entry point of the console script."""
    sys.exit(evoros(sys.argv[1:]))


def _new(config: "DictConfig", folder: Path) -> "Work":
    from evoros.session import new

    return new(config, folder)


def _resumed(folder: Path, overrides: Sequence[str], config_dir: str | None) -> "Work":
    from evoros.session import resumed

    return resumed(folder, overrides, config_dir)


def _summary(folder: Path) -> str:
    from evoros.summary import summary

    return summary(folder)


evoros = Command("evoros", "config", _new, _resumed, _summary)
