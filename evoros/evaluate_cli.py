"""The command ``evoros-evaluate``: scores given designs, or goes on with an evaluation."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.command import Command

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from evoros.session import Display


def main() -> None:
    """Entry point of the console script."""
    sys.exit(evaluate(sys.argv[1:]))


def _start(config: "DictConfig", folder: Path, display: "Display") -> None:
    from evoros.assessment import start

    start(config, folder, display)


def _resume(
    folder: Path, overrides: Sequence[str], config_dir: str | None, display: "Display"
) -> None:
    from evoros.assessment import resume

    resume(folder, overrides, config_dir, display)


def _summary(folder: Path) -> str:
    from evoros.summary import evaluation

    return evaluation(folder)


evaluate = Command("evoros-evaluate", "evaluate", _start, _resume, _summary)
