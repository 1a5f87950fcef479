"""The subcommand ``evaluate``: scores given designs."""

from evoros.cli.command import Command
from evoros.cli.kind import Works


def _load() -> Works:
    from evoros.cli.summary import judge_evaluation, summarize_evaluation
    from evoros.session.evaluation import create_evaluation, open_evaluation
    from evoros.session.repeated import reopen_evaluation

    return Works(
        create_evaluation,
        open_evaluation,
        reopen_evaluation,
        summarize_evaluation,
        judge_evaluation,
    )


evaluate = Command("evoros evaluate", "evaluate", "like", _load)
