"""A map of designs in the page of a report, as its template reads it."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.colors import to_hex

from ..tables.records import Record

CMAP = "viridis"


class Mark(NamedTuple):
    """A cell or a point; places and sizes are shares of the map in percent, from its lower left."""

    x: float
    y: float
    width: float  # 0: a point
    height: float
    colour: str
    name: str
    label: str  # name, and where it is
    playable: bool
    picture: Markup  # empty: none


class Tick(NamedTuple):
    """A number at an axis, at a share of its length in percent."""

    at: float
    text: str


@dataclass(frozen=True)
class DesignMap:
    """One map of the page."""

    name: str  # of its figure
    axes: tuple[str, str]
    ticks: tuple[list[Tick], list[Tick]]
    marks: list[Mark]
    dots: list[tuple[float, float]]  # of other designs, in percent
    designs: list[tuple[Record, int]]  # of the marks
    data: Markup  # all designs, as JSON
    low: float  # fitness at the ends of the scale of colours
    high: float
    view_box: str  # of the pictures
    outline: Markup  # of the robot, which all pictures share
    key: str = ""  # no other map of the page has it
    title: str = ""  # its treatment, if the study has several
    runs: int = 1  # whose designs it shows

    @property
    def points(self) -> Any:
        """The places of the marks (n, 2), by which designs that lie apart are found."""
        return np.array([(mark.x, mark.y) for mark in self.marks])

    @property
    def corner(self) -> list[str]:
        """The numbers of ``view_box``."""
        return self.view_box.split()

    @property
    def scale(self) -> str:
        """The colours from low to high fitness."""
        return ", ".join(colour_share(place / 8) for place in range(9))

    @property
    def played(self) -> int:
        """The number of designs whose missions the run has kept."""
        return sum(mark.playable for mark in self.marks)


def colour_share(share: float) -> str:
    """Return the colour of a fitness, as a share of the way from the lowest to the highest."""
    return to_hex(mpl.colormaps[CMAP](share))
