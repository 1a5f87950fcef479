"""The command ``evoros``: evolves, or goes on with a run."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.cli.command import Command

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from evoros.session.run import Work


def main() -> None:
    """Entry point of the console script."""
    sys.exit(evoros(sys.argv[1:]))


def _new(config: "DictConfig", folder: Path) -> "Work":
    from evoros.session.run import create_run

    return create_run(config, folder)


def _resumed(folder: Path, overrides: Sequence[str], config_dir: str | None) -> "Work":
    from evoros.session.run import open_run

    return open_run(folder, overrides, config_dir)


def _summary(folder: Path) -> str:
    from evoros.cli.summary import summary

    return summary(folder)


evoros = Command("evoros", "config", _new, _resumed, _summary)
