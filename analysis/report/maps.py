"""The archive and the front of a study as maps in the page, whose marks choose a design.

A mark is a cell of the archive or a point of the front. Its design is drawn beside the map, and its
missions can be played if the run has kept them.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import pandas as pd
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup
from matplotlib.colors import to_hex
from matplotlib.ticker import MaxNLocator

from evoros.base.arrays import Array
from evoros.base.errors import InputError

from ..designs.cones import fit_window, robot_length
from ..drawing.cells import LENGTHS as SHORT
from ..drawing.gallery import LENGTHS
from ..subcommands import parse
from ..tables.agents import choose_robot
from ..tables.candidates import place_candidates
from ..tables.elites import read_archive, read_front
from ..tables.measured import Axis
from ..tables.records import Record
from ..tables.shown import has_missions
from ..tables.study import Study
from .pictures import draw_outline, draw_sensors
from .playback import encode_parts, encode_sensors

MOST_DRAWN = 18
"""Maximum number of cells along a descriptor into which designs are drawn."""
MOST_DOTS = 3000
MARGIN = 0.06  # of a front around its points, as a share of its width
CMAP = "viridis"
FITNESS = "fitness"
BETTER = {1.0: "more is better", -1.0: "less is better"}
TITLES = {"archive": "Archive", "front": "Front"}


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

    name: str
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
        return ", ".join(_colour(place / 8) for place in range(9))

    @property
    def played(self) -> int:
        """The number of designs whose missions the run has kept."""
        return sum(mark.playable for mark in self.marks)


def make_maps(study: Study, options: argparse.Namespace) -> dict[str, DesignMap]:
    """Make the maps for which the runs have recorded measures, of the first robot."""
    makers = {"archive": _map_archive, "front": _map_front}
    maps = {}
    first = choose_robot(study, None).study
    for name, make in makers.items():
        try:
            maps[name] = make(first, parse([name, *map(str, options.folders)]))
        except InputError:
            continue  # the section of its figure says why
    return maps


def _map_archive(study: Study, options: argparse.Namespace) -> DesignMap:
    archive = read_archive(study, options)
    (x, y, cells), elites = archive.grid, archive.select_elites(range(len(study.records)))
    width = 100 / cells
    corners = elites[["cell_x", "cell_y"]].to_numpy(float) * width
    ground = _Ground("archive", (x, y), (x.bounds, y.bounds), width, drawn=cells <= MOST_DRAWN)
    return _make_map(study, elites, corners, ground)


def _map_front(study: Study, options: argparse.Namespace) -> DesignMap:
    shown = read_front(study, options)
    x, y, front = shown.x, shown.y, shown.select_front(range(len(study.records)))
    columns = [x.column, y.column]
    everything = shown.candidates[columns].to_numpy(float)
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = MARGIN * np.where(high > low, high - low, 1.0)
    bounds = tuple(zip((low - margin).tolist(), (high + margin).tolist(), strict=True))
    places = _to_percent(everything, bounds)
    dots = np.unique(np.round(places, 1), axis=0)[:MOST_DOTS].tolist()
    ground = _Ground("front", (x, y), bounds, dots=[(across, up) for across, up in dots])
    return _make_map(study, front, _to_percent(front[columns], bounds), ground)


def _to_percent(points: Any, bounds: Sequence[tuple[float, float]]) -> Array:
    low, high = np.array(bounds).T
    shares: Array = 100 * (np.asarray(points, dtype=float) - low) / (high - low)
    return shares


class _Ground(NamedTuple):
    """The axes of a map, and its content besides the marks."""

    name: str
    axes: tuple[Axis, Axis]
    bounds: Sequence[tuple[float, float]]
    width: float = 0.0  # of a mark, in percent; 0: marks are points
    drawn: bool = False  # whether marks have pictures
    dots: Sequence[tuple[float, float]] = ()  # of other designs, in percent

    @property
    def labels(self) -> tuple[str, str]:
        """The labels of the axes, which tell which direction is better for points."""
        x, y = (a.label if self.width else f"{a.label} ({BETTER[a.sign]})" for a in self.axes)
        return x, y


def _make_map(study: Study, table: pd.DataFrame, places: Array, ground: _Ground) -> DesignMap:
    """Make a map of designs, whose marks are at ``places`` (n, 2), in percent."""
    records = [study.records[int(place)] for place in table.place]
    designs = [
        place_candidates(table.loc[[row]], record)
        for row, record in zip(table.index, records, strict=True)
    ]
    context = study.records[0].context
    reach = SHORT * robot_length(context)
    x_low, x_high, _, side = fit_window([context], pd.concat(designs), reach)
    x_ticks, y_ticks = (list(_list_ticks(interval)) for interval in ground.bounds)
    low, high = float(table.fitness.min()), float(table.fitness.max())
    shares = (table.fitness - low) / (high - low) if high > low else table.fitness * 0.0 + 1.0
    pictures = [draw_sensors(sensors, reach) if ground.drawn else Markup() for sensors in designs]
    marked = table.assign(
        picture=pictures, colour=shares.map(_colour), record=pd.Series(records, table.index)
    )
    return DesignMap(
        name=ground.name,
        axes=ground.labels,
        ticks=(x_ticks, y_ticks),
        marks=list(_list_marks(marked, places, ground, len(study.records) > 1)),
        dots=list(ground.dots),
        designs=[(record, int(design)) for record, design in zip(records, table.id, strict=True)],
        data=_encode_designs(study, table, ground.axes, designs),
        low=low,
        high=high,
        view_box=f"{-side:.3f} {-x_high:.3f} {2 * side:.3f} {x_high - x_low:.3f}",
        outline=draw_outline(context),
    )


def _list_marks(
    table: pd.DataFrame, places: Array, ground: _Ground, several: bool
) -> Iterator[Mark]:
    """Yield the mark of each design; of several runs, its name has the run."""
    for row, (x, y) in zip(table.to_dict("records"), places.round(3).tolist(), strict=True):
        run = f" of {row['record'].name}" if several else ""
        name = f"design {row['id']}{run}, fitness {row['fitness']:.2f}"
        label = ", ".join([name, *(f"{a.label} {row[a.column]:.2f}" for a in ground.axes)])
        looks = row["colour"], name, label, has_missions(row["record"], row["id"]), row["picture"]
        yield Mark(x, y, ground.width, ground.width, *looks)


def _encode_designs(
    study: Study, table: pd.DataFrame, axes: Sequence[Axis], designs: Sequence[pd.DataFrame]
) -> Markup:
    """Encode the picture and the text of each design beside the map."""
    context = study.records[0].context
    shown = [axis for axis in axes if axis.label != FITNESS]
    encoded = [
        {
            "run": study.records[int(row["place"])].name,
            "design": int(row["id"]),
            "values": [
                [f"{FITNESS}, recorded", f"{row['fitness']:.3f}"],
                *([axis.label, f"{row[axis.column]:.3f}"] for axis in shown),
            ],
            "sensors": list(encode_sensors(sensors)),
        }
        for row, sensors in zip(table.to_dict("records"), designs, strict=True)
    ]
    reach = LENGTHS * robot_length(context)
    content = {"parts": encode_parts(context), "reach": reach, "designs": encoded}
    return htmlsafe_json_dumps(content, separators=(",", ":"))


def _colour(share: float) -> str:
    return to_hex(mpl.colormaps[CMAP](share))


def _list_ticks(bounds: tuple[float, float]) -> Iterator[Tick]:
    low, high = bounds
    for value in np.asarray(MaxNLocator(5).tick_values(low, high)).tolist():
        if low - 1e-9 <= value <= high + 1e-9:
            yield Tick(round(100 * (value - low) / (high - low), 3), f"{value:g}")
