"""The kinds of work that commands start and resume."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.analysis.run_figures import check_figures
from evoros.terminal.console import DONE

if TYPE_CHECKING:
    from evoros.config.configuration import Configuration
    from evoros.session.work import Work


@dataclass(frozen=True)
class Works:
    """The functions of a kind of work with folders."""

    create: "Callable[[Configuration, Path], Work]"
    open: "Callable[[Path, Sequence[str], str | None], Work]"
    reopen: "Callable[[Configuration, Path, Sequence[str], str | None], Work | None]"
    """Opens the folder of a job of a sweep that is typed again; None if it is complete."""
    summarize: Callable[[Path], str]  # the result that is printed when a folder is finished
    judge: Callable[[Path], int] = lambda folder: DONE  # the exit status of a finished folder


@dataclass(frozen=True)
class Kind:
    """A kind of work, by the command that does it.

    It loads its functions when they are needed, so that the first message is quick.
    """

    name: str
    primary: str  # its own file of conf/, into which everything else is composed
    folder_key: str  # to which a folder that is typed without a key may belong
    load: Callable[[], Works]

    def create(self, config: "Configuration", folder: Path) -> "Work":
        """Build and record new work.

        Raises:
            InputError: something cannot be used; the folder is unchanged.
        """
        check_figures(config.values)
        return self.load().create(config, folder)
