"""The command ``evoros`` without a subcommand: starts a run, or a sweep of them."""

from evoros.cli.command import Command
from evoros.cli.kind import Works


def _load() -> Works:
    from evoros.cli.summary import summarize_run
    from evoros.session.repeated import reopen_run
    from evoros.session.run import create_run, open_run

    return Works(create_run, open_run, reopen_run, summarize_run)


run = Command("evoros", "config", "hydra.run.dir", _load)
