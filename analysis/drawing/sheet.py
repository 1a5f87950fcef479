"""Panels on a page, placed to the inch: for equally scaled axes, whose shape is given.

Matplotlib's layouts would fit such panels into cells of other shapes, and leave them unaligned.
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
        """Of the page."""
        return sum(self.heads) + self.panel * sum(self.ratios) + self.bottom

    def figure(self) -> Figure:
        """An empty page."""
        return Figure(figsize=(self.width, self.height))

    def axes(self, figure: Figure, row: int, column: int) -> Axes:
        """The axes of one panel, added to the page."""
        tall = self.ratios[row] * self.panel
        below = sum(self.heads[row + 1 :]) + sum(self.ratios[row + 1 :]) * self.panel
        across = self.left + column * (self.panel + self.gap)
        return self.box(figure, (across, self.bottom + below), (self.panel, tall))

    def box(self, figure: Figure, corner: tuple[float, float], size: tuple[float, float]) -> Axes:
        """Axes anywhere on the page, from its lower left."""
        wide, tall = self.width, self.height
        return figure.add_axes((corner[0] / wide, corner[1] / tall, size[0] / wide, size[1] / tall))
