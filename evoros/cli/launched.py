"""Jobs of a sweep that a launcher or a sweeper of Hydra starts, in processes of its own."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.analysis.run_figures import draw_figure
from evoros.base.errors import InputError, RunStopped
from evoros.cli.reporting import JobResult
from evoros.session.overview import survey
from evoros.session.status import NoDisplay
from evoros.terminal.log import log_everything, log_for_job, log_to_terminal

if TYPE_CHECKING:
    from evoros.config.jobs import Job
    from evoros.session.work import Work


@dataclass(frozen=True)
class JobRunner:
    """Runs a job in the process in which it is called. It pickles.

    ``build`` and ``explain`` are as in ``Sweep``.
    """

    build: "Callable[[Job], Work | None]"
    explain: Callable[[Path, BaseException], JobResult]

    def __call__(self, job: "Job") -> float:
        """Run the job and return its fitness: validated, if it has been.

        Raises:
            InputError, RunStopped: in one line, why it ended.
        """
        with log_to_terminal(again=True), log_everything(), log_for_job(str(job.folder)):
            try:
                work = self.build(job)
                if work is not None:
                    work.run(NoDisplay(), draw_figure)
            except Exception as error:
                with suppress(OSError):  # it has files; Hydra makes an empty one first
                    job.folder.rmdir()
                result = self.explain(job.folder, error)
                kind = InputError if isinstance(error, InputError) else RunStopped
                raise kind(result.message) from None
        overview = survey(job.folder)
        fitness = overview.best if overview.validated is None else overview.validated
        assert fitness is not None, "a finished run has a best individual"
        return fitness
