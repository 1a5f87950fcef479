"""Panels at exact positions on a page, for axes with equal scales, whose shape is given.

Matplotlib's layouts would fit such panels into cells of other shapes and leave them unaligned.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure


@dataclass(frozen=True)
class Sheet:
    """Rows of panels of one width; all lengths in inches."""

    width: float
    columns: int
    ratios: Sequence[float]  # of each row: height of its panels over their width
    heads: Sequence[float]  # room above each row
    left: float = 0.56
    right: float = 0.08
    bottom: float = 0.4
    gap: float = 0.15  # between columns

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
        """Add axes anywhere on the page; ``corner`` is their lower left."""
        (x, y), (width, height) = corner, size
        return figure.add_axes(
            (x / self.width, y / self.height, width / self.width, height / self.height)
        )
