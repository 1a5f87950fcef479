"""What all figures share: widths, fonts, colours, and the same bytes for the same input."""

from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

COLUMN_IN = 3.5  # width of one column of a two-column page
PAGE_IN = 7.0  # and of both
STYLE: dict[Any, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "legend.fontsize": 7,
    "text.parse_math": False,  # names from folders may have a $
    "axes.spines.top": False,
    "axes.spines.right": False,
    "pdf.fonttype": 42,  # text stays text, as most publishers ask
    "svg.hashsalt": "evoros",  # else the names inside an SVG are random
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
"""The colours of Okabe and Ito (2008), which the colour-blind can tell apart."""
CATEGORIES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, YELLOW)
"""In the order in which they are dealt: the first differ in grey, too."""


def width(columns: int | None, default: int = 1) -> float:
    """Width [in] of a figure over so many columns of a page."""
    return COLUMN_IN if (columns or default) == 1 else PAGE_IN


def treatment_colours(treatments: Sequence[str]) -> dict[str, str]:
    """A colour for each treatment, the same in all figures of a study."""
    names = dict.fromkeys(treatments)
    return {name: CATEGORIES[i % len(CATEGORIES)] for i, name in enumerate(names)}


def letter(number: int) -> str:
    """A ... Z, AA, BB ...: what stands for a name that is too long for its place."""
    return chr(ord("A") + number % 26) * (1 + number // 26)


def save(
    figure: Figure, file: Path | str | IO[bytes], kind: str = "svg", as_text: bool = False
) -> None:
    """Write a figure as ``svg``, ``pdf`` or ``png``: the same bytes for the same figure.

    The letters of an SVG are drawn, or, ``as_text``, left to the fonts of whoever shows it.
    """
    dated = {_DATES[kind]: None} if kind in _DATES else {}
    with mpl.rc_context({**STYLE, "svg.fonttype": "none" if as_text else "path"}):
        _settle(figure)
        figure.savefig(file, format=kind, metadata=dated, dpi=300)


def _settle(figure: Figure) -> None:
    """Lay the figure out, for good.

    The last digits of what matplotlib's solver finds differ from time to time; they are cut off.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    parts = [*figure.subfigs]
    for part in parts:
        parts += part.subfigs
        part.bbox_relative.set_points(np.round(part.bbox_relative.get_points(), 6))
    for axes in figure.axes:
        x, y, wide, high = np.round(axes.get_position(original=True).bounds, 6).tolist()
        axes.set_position((x, y, wide, high))
