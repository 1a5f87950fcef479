"""The command ``evoros-evaluate``: scores given designs, or goes on with an evaluation."""

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
    sys.exit(evaluate(sys.argv[1:]))


def _new(config: "DictConfig", folder: Path) -> "Work":
    from evoros.session.evaluation import create_evaluation

    return create_evaluation(config, folder)


def _resumed(folder: Path, overrides: Sequence[str], config_dir: str | None) -> "Work":
    from evoros.session.evaluation import open_evaluation

    return open_evaluation(folder, overrides, config_dir)


def _summary(folder: Path) -> str:
    from evoros.cli.summary import evaluation

    return evaluation(folder)


evaluate = Command("evoros-evaluate", "evaluate", _new, _resumed, _summary)
