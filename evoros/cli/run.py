"""The command ``evoros``: starts or resumes a run."""

from functools import partial

from evoros.cli.command import Command
from evoros.cli.kind import Works
from evoros.terminal.console import run_main


def _load() -> Works:
    from evoros.cli.summary import summarize_run
    from evoros.session.repeated import reopen_run
    from evoros.session.run import create_run, open_run

    return Works(create_run, open_run, reopen_run, summarize_run)


evoros = Command("evoros", "config", _load)
main = partial(run_main, evoros)
