"""The command ``evoros``: starts or resumes a run."""

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
    run_main(evoros)


def _create(config: "Configuration", folder: Path) -> "Work":
    from evoros.session.run import create_run

    return create_run(config, folder)


def _open(folder: Path, overrides: Sequence[str], config_dir: str | None) -> "Work":
    from evoros.session.run import open_run

    return open_run(folder, overrides, config_dir)


def _reopen(
    config: "Configuration", folder: Path, overrides: Sequence[str], config_dir: str | None
) -> "Work | None":
    from evoros.session.repeated import reopen_run

    return reopen_run(config, folder, overrides, config_dir)


def _summarize(folder: Path) -> str:
    from evoros.cli.summary import summarize_run

    return summarize_run(folder)


evoros = Command("evoros", "config", _create, _open, _reopen, _summarize)
