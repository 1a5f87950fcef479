"""The command ``evoros``: evolves, or goes on with a run."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.command import DONE, INPUT, INTERRUPTED, STOPPED, Command

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from evoros.session import Display

__all__ = ["DONE", "INPUT", "INTERRUPTED", "STOPPED", "evoros", "main"]


def main() -> None:
    """Entry point of the console script."""
    sys.exit(evoros(sys.argv[1:]))


def _start(config: "DictConfig", folder: Path, display: "Display") -> None:
    from evoros.session import start

    start(config, folder, display)


def _resume(
    folder: Path, overrides: Sequence[str], config_dir: str | None, display: "Display"
) -> None:
    from evoros.session import resume

    resume(folder, overrides, display, config_dir)


def _summary(folder: Path) -> str:
    from evoros.summary import summary

    return summary(folder)


evoros = Command("evoros", "config", _start, _resume, _summary)
