"""The command ``evoros-evaluate``: scores given designs, or resumes an evaluation."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.base.console import run_main
from evoros.cli.command import Command

if TYPE_CHECKING:
    from evoros.config.configuration import Configuration
    from evoros.session.work import Work


def main() -> None:
    """Entry point of the console script."""
    run_main(evaluate)


def _create(config: "Configuration", folder: Path) -> "Work":
    from evoros.session.evaluation import create_evaluation

    return create_evaluation(config, folder)


def _open(folder: Path, overrides: Sequence[str], config_dir: str | None) -> "Work":
    from evoros.session.evaluation import open_evaluation

    return open_evaluation(folder, overrides, config_dir)


def _reopen(
    config: "Configuration", folder: Path, overrides: Sequence[str], config_dir: str | None
) -> "Work | None":
    from evoros.session.repeated import reopen_evaluation

    return reopen_evaluation(config, folder, overrides, config_dir)


def _summarize(folder: Path) -> str:
    from evoros.cli.summary import summarize_evaluation

    return summarize_evaluation(folder)


evaluate = Command("evoros-evaluate", "evaluate", _create, _open, _reopen, _summarize)
