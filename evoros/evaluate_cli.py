"""The command ``evoros-evaluate``: scores given designs, or goes on with an evaluation."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.command import Command

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from evoros.session import Work


def main() -> None:
    """Entry point of the console script."""
    sys.exit(evaluate(sys.argv[1:]))


def _new(config: "DictConfig", folder: Path) -> "Work":
    from evoros.assessment import new

    return new(config, folder)


def _resumed(folder: Path, overrides: Sequence[str], config_dir: str | None) -> "Work":
    from evoros.assessment import resumed

    return resumed(folder, overrides, config_dir)


def _summary(folder: Path) -> str:
    from evoros.summary import evaluation

    return evaluation(folder)


evaluate = Command("evoros-evaluate", "evaluate", _new, _resumed, _summary)
