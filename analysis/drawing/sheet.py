"""Panels at exact positions on a page, which matplotlib's layouts would misalign."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.gridspec import GridSpec

from .style import COLUMN_IN, scale_type

SMALL = "small"
LINE_IN, TABLE_IN, EDGE_IN = 0.13, 3.38, 0.06  # line height, table width and distance from the edge
_SPARE_IN = 0.03
Heads = Mapping[str, tuple[float, str]]  # position (fraction of the width) and alignment per column


@dataclass(frozen=True)
class Sheet:
    """Rows of panels of equal width; lengths are in inches."""

    width: float
    columns: int
    ratios: Sequence[float]  # height divided by width of the panels in each row
    heads: Sequence[float]  # space above each row
    left: float = 0.56
    right: float = 0.08
    bottom: float = 0.4
    gap: float = 0.15  # gap between columns

    @property
    def panel(self) -> float:
        """The width of a panel."""
        room = self.width - self.left - self.right - (self.columns - 1) * self.gap
        return room / self.columns

    @property
    def height(self) -> float:
        """The height of the page."""
        return sum(self.heads) + self.panel * sum(self.ratios) + self.bottom

    def make_figure(self) -> Figure:
        """Make an empty page."""
        return Figure(figsize=(self.width, self.height))

    def add_panel(self, figure: Figure, row: int, column: int) -> Axes:
        """Add the axes of one panel to the page."""
        panel_height = self.ratios[row] * self.panel
        below = sum(self.heads[row + 1 :]) + sum(self.ratios[row + 1 :]) * self.panel
        x = self.left + column * (self.panel + self.gap)
        return self.add_box(figure, (x, self.bottom + below), (self.panel, panel_height))

    def add_box(
        self, figure: Figure, corner: tuple[float, float], size: tuple[float, float]
    ) -> Axes:
        """Add axes anywhere on the page, with the lower left ``corner``."""
        (x, y), (width, height) = corner, size
        return figure.add_axes(
            (x / self.width, y / self.height, width / self.width, height / self.height)
        )


def table_height(rows: int, notes: int = 0) -> float:
    """Return the height [in] of a table with column heads and ``notes`` lines of notes."""
    return scale_type(LINE_IN) * (rows + 2 + notes)


def fit_height(
    figure: Figure,
    panels: Sequence[Any],
    rows: int,
    stack: GridSpec | None = None,
    below: Sequence[float] = (),
) -> None:
    """Fit the height of a figure to its rows of panels, above parts of heights ``below`` [in]."""

    def resize(height: float) -> None:
        figure.set_figheight(height + sum(below))
        if stack is not None:
            stack.set_height_ratios((height, *below))

    (left, right), (low, high) = panels[0].get_xlim(), panels[0].get_ylim()
    width = figure.get_figwidth() / len({axes.get_subplotspec().colspan for axes in panels})
    tall = rows * (width * (high - low) / (right - left) + 2.0) + 2.0  # more than the panels need
    resize(tall)
    engine: Any = figure.get_layout_engine()
    engine.execute(figure)
    unused = []
    for axes in panels:
        slot = axes.get_position(original=True).transformed(axes.get_figure().transSubfigure)
        used = axes.get_tightbbox()  # includes titles and labels
        unused.append(max(0.0, slot.y1 - used.y1) + max(0.0, used.y0 - slot.y0))
    # Panels of another size may have different ticks, so leave some room.
    resize(round(tall - rows * (min(unused) / figure.dpi - _SPARE_IN), 2))


@dataclass(frozen=True)
class Layout:
    """Panels, each with a table below; lengths are in inches."""

    count: int
    width: float  # figure width; wide figures have two columns of panels
    panel: float  # height
    table: float  # table height; 0 for no tables

    @property
    def _columns(self) -> int:
        return min(self.count, 2) if self.width > 1.5 * COLUMN_IN else 1

    @property
    def table_size(self) -> tuple[float, float]:
        """The width and height [in] of a table's subfigure."""
        return self.width / self._columns, self.table

    def make_figure(self) -> tuple[Figure, list[tuple[SubFigure, SubFigure]]]:
        """Make a figure with (panel, table) subfigures, which are the same without tables."""
        rows = ceil(self.count / self._columns)
        height = (self.panel + self.table) * rows
        figure = Figure(figsize=(self.width, height), layout="constrained")
        cells = figure.subfigures(rows, self._columns, squeeze=False).ravel()
        if not self.table:
            return figure, [(cell, cell) for cell in cells[: self.count]]
        ratios = [self.panel, self.table]
        halves = [
            cell.subfigures(2, 1, squeeze=False, height_ratios=ratios).ravel()
            for cell in cells[: self.count]
        ]
        return figure, [(top, bottom) for top, bottom in halves]


def write_table(
    figure: SubFigure,
    heads: Heads,
    rows: Sequence[Sequence[str]],
    size_in: tuple[float, float],
    note: str = "",
) -> None:
    """Write column heads, rows and a note into a subfigure of size ``size_in``, from the top."""
    width, height = size_in
    table = min(scale_type(TABLE_IN), width - 2 * EDGE_IN)
    left = max(EDGE_IN, (width - table) / 2)

    def put(x: float, line: int, text: str, side: str = "left", weight: str = "normal") -> None:
        place = (left + table * x) / width, 1 - (line + 0.5) * scale_type(LINE_IN) / height
        figure.text(*place, text, ha=side, va="center", fontsize=SMALL, weight=weight)

    for head, (x, side) in heads.items():
        put(x, 0, head, side, "bold")
    for line, row in enumerate(rows, 1):
        for (x, side), cell in zip(heads.values(), row, strict=True):
            put(x, line, cell, side)
    for line, text in enumerate(note.split("\n"), len(rows) + 1):
        put(0, line, text)
