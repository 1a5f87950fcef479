"""A small table of text below a panel, at the same places at any width of the figure."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import SubFigure

SMALL_PT = 6.5
LINE_IN, WIDE_IN, EDGE_IN = 0.13, 3.38, 0.06
Heads = Mapping[str, tuple[float, str]]
"""Columns: where they are, of the table's width, and which side of them is there."""


def height_in(rows: int, note: bool = False) -> float:
    """What so many rows need below their heads, with a note or without."""
    return LINE_IN * (rows + 2 + note)


def write(
    figure: SubFigure,
    heads: Heads,
    rows: Sequence[Sequence[str]],
    size_in: tuple[float, float],
    note: str = "",
) -> None:
    """Write heads, rows and a note from the top of a part of a figure of that size, centred."""
    width, height = size_in
    left = max(EDGE_IN, (width - WIDE_IN) / 2)

    def put(x: float, line: int, text: str, side: str = "left", weight: str = "normal") -> None:
        at = (left + WIDE_IN * x) / width, 1 - (line + 0.5) * LINE_IN / height
        figure.text(*at, text, ha=side, va="center", fontsize=SMALL_PT, weight=weight)

    for head, (x, side) in heads.items():
        put(x, 0, head, side, "bold")
    for line, row in enumerate(rows, 1):
        for (x, side), cell in zip(heads.values(), row, strict=True):
            put(x, line, cell, side)
    put(0, len(rows) + 1, note)
