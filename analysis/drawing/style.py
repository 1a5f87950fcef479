"""What all figures share: widths, fonts, colours, and reproducible files."""

from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

COLUMN_IN = 3.5  # width of one column of a two-column page
PAGE_IN = 7.0  # width of both columns
STYLE: dict[Any, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "legend.fontsize": 7,
    "text.parse_math": False,  # names of folders may contain a $
    "axes.spines.top": False,
    "axes.spines.right": False,
    "pdf.fonttype": 42,  # embeds TrueType fonts, as most publishers require
    "svg.hashsalt": "evoros",  # otherwise the ids in an SVG are random
}
KINDS = ("pdf", "svg", "png")
_DATES = {"svg": "Date", "pdf": "CreationDate"}

BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILLION, PURPLE = (
    "#000000",
    "#e69f00",
    "#56b4e9",
    "#009e73",
    "#f0e442",
    "#0072b2",
    "#d55e00",
    "#cc79a7",
)
"""The colours of Okabe and Ito (2008), which colour-blind readers can tell apart."""
CATEGORIES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, YELLOW)
"""The order in which colours are assigned; the first also differ in grey."""


def figure_width(columns: int | None, default: int = 1) -> float:
    """Return the width [in] of a figure over one or two columns of a page."""
    return COLUMN_IN if (columns or default) == 1 else PAGE_IN


def assign_colours(treatments: Sequence[str]) -> dict[str, str]:
    """Assign a colour to each treatment, the same in all figures of a study."""
    names = dict.fromkeys(treatments)
    return {name: CATEGORIES[i % len(CATEGORIES)] for i, name in enumerate(names)}


def letter(number: int) -> str:
    """Return A ... Z, AA, BB ..., which stand for names that are too long for their place."""
    return chr(ord("A") + number % 26) * (1 + number // 26)


def save(
    figure: Figure, file: Path | str | IO[bytes], kind: str = "svg", as_text: bool = False
) -> None:
    """Write a figure as ``svg``, ``pdf`` or ``png``; equal figures give equal bytes.

    The letters of an SVG are outlines or, with ``as_text``, text in the viewer's fonts.
    """
    metadata = {_DATES[kind]: None} if kind in _DATES else {}
    with mpl.rc_context({**STYLE, "svg.fonttype": "none" if as_text else "path"}):
        _fix_layout(figure)
        figure.savefig(file, format=kind, metadata=metadata, dpi=300)


def _fix_layout(figure: Figure) -> None:
    """Compute the layout and round it.

    The last digits that matplotlib's solver finds vary from call to call.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    parts = [*figure.subfigs]
    for part in parts:
        parts += part.subfigs
        part.bbox_relative.set_points(np.round(part.bbox_relative.get_points(), 6))
    for axes in figure.axes:
        x, y, width, height = np.round(axes.get_position(original=True).bounds, 6).tolist()
        axes.set_position((x, y, width, height))
