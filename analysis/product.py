"""The results of a subcommand of ``evoros analyze``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import pandas as pd
from matplotlib.figure import Figure

from evoros.terminal.console import DONE


@dataclass(frozen=True, eq=False)
class Product:
    """A figure, the numbers behind it, messages, and other files."""

    table: pd.DataFrame | None = None  # becomes SUBCOMMAND.csv
    figure: Figure | None = None  # becomes SUBCOMMAND.FORMAT
    messages: Sequence[str] = ()  # lines for standard output
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)  # further ones, by file
    files: Mapping[str, bytes] = field(default_factory=dict)  # by name
    folder: str = ""
    """If there is one, the files are by their paths in this folder, which is written as a whole."""
    status: int = DONE
    """The exit status of the command; others than 0 are those of requirements."""


def to_csv(table: pd.DataFrame) -> bytes:
    """Return the content of a table's CSV file."""
    return table.to_csv(index=False, lineterminator="\n").encode()
