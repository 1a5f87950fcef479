"""What a subcommand of ``evoros-analyze`` makes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import pandas as pd
from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Product:
    """A figure, the numbers behind it, what is to be said of it, and other files."""

    table: pd.DataFrame | None = None  # becomes SUBCOMMAND.csv
    figure: Figure | None = None  # becomes SUBCOMMAND.FORMAT
    said: Sequence[str] = ()  # lines for standard output
    files: Mapping[str, bytes] = field(default_factory=dict)  # by name
