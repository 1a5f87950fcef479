"""The results of a subcommand of ``evoros analyze``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import pandas as pd
from matplotlib.figure import Figure

from evoros.terminal.console import DONE


@dataclass(frozen=True, eq=False)
class Product:
    """A figure, its data, messages, and other files."""

    table: pd.DataFrame | None = None  # becomes SUBCOMMAND.csv
    figure: Figure | None = None  # becomes SUBCOMMAND.FORMAT
    messages: Sequence[str] = ()  # lines for standard output
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)  # further tables, by file name
    files: Mapping[str, bytes] = field(default_factory=dict)  # content by file name
    folder: str = ""
    """If set, this folder is written as a whole, and ``files`` are by path inside it."""
    status: int = DONE
    """The exit status of the command; other values come from requirements."""


def to_csv(table: pd.DataFrame) -> bytes:
    """Return a table as the content of a CSV file."""
    return table.to_csv(index=False, lineterminator="\n").encode()
