"""What all figures share: their width and fonts, and files that are the same for the same input."""

from pathlib import Path
from typing import IO, Any

import matplotlib as mpl
from matplotlib.figure import Figure

COLUMN_IN = 3.5  # width of one column of a two-column page
STYLE: dict[Any, Any] = {
    "font.size": 8,
    "pdf.fonttype": 42,  # text stays text, as most publishers ask
    "svg.fonttype": "none",
    "svg.hashsalt": "evoros",  # else the names inside an SVG are random
}
_DATES = {"svg": "Date", "pdf": "CreationDate"}


def save(figure: Figure, file: Path | str | IO[bytes], kind: str = "svg") -> None:
    """Write a figure as ``svg``, ``pdf`` or ``png``: the same bytes for the same figure."""
    dated = {_DATES[kind]: None} if kind in _DATES else {}
    with mpl.rc_context(STYLE):
        figure.savefig(file, format=kind, metadata=dated, dpi=300)
