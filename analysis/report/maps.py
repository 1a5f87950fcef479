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

from ..drawing.cells import LENGTHS as SHORT
from ..drawing.gallery import LENGTHS
from ..measures.cones import fit_window, outline_part, robot_length, trace_cones
from ..subcommands import parse
from ..tables.agents import choose_robot
from ..tables.candidates import place_candidates
from ..tables.elites import read_archive, read_front
from ..tables.measured import Axis
from ..tables.records import Record
from ..tables.shown import has_missions
from ..tables.study import Study
from .playback import encode_parts, encode_sensors

MOST_DRAWN = 18
"""Maximum number of cells along a descriptor into which designs are drawn."""
MOST_DOTS = 3000
MARGIN = 0.06  # of a front around its points, as a share of its width
CMAP = "viridis"
FITNESS = "fitness"
BETTER = {1.0: "more is better", -1.0: "less is better"}
TITLES = {"archive": "Archive", "front": "Front"}
_OUTLINE = Markup(
    '<path d="{}" fill="{}" stroke="#000" stroke-width=".5" vector-effect="non-scaling-stroke"/>'
)


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
    (x, y, cells), elites = archive.grid, archive.elites
    width = 100 / cells
    corners = elites[["cell_x", "cell_y"]].to_numpy(float) * width
    return _make_map(
        "archive", study, elites, (x, y), corners, width, (x.bounds, y.bounds), cells <= MOST_DRAWN
    )


def _map_front(study: Study, options: argparse.Namespace) -> DesignMap:
    x, y, candidates, front = read_front(study, options)
    columns = [x.column, y.column]
    everything = candidates[columns].to_numpy(float)
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = MARGIN * np.where(high > low, high - low, 1.0)
    bounds = tuple(zip((low - margin).tolist(), (high + margin).tolist(), strict=True))
    places = [_to_percent(points, bounds) for points in (front[columns], everything)]
    dots = np.unique(np.round(places[1], 1), axis=0)[:MOST_DOTS]
    return _make_map("front", study, front, (x, y), places[0], 0.0, bounds, False, dots)


def _to_percent(points: Any, bounds: Sequence[tuple[float, float]]) -> Array:
    low, high = np.array(bounds).T
    shares: Array = 100 * (np.asarray(points, dtype=float) - low) / (high - low)
    return shares


def _make_map(
    name: str,
    study: Study,
    table: pd.DataFrame,
    axes: tuple[Axis, Axis],
    places: Array,
    width: float,
    bounds: Sequence[tuple[float, float]],
    drawn: bool,
    dots: Array | None = None,
) -> DesignMap:
    records = [study.records[int(place)] for place in table.place]
    numbers = [int(number) for number in table.id]
    designs = [
        place_candidates(table.loc[[row]], record)
        for row, record in zip(table.index, records, strict=True)
    ]
    low, high = float(table.fitness.min()), float(table.fitness.max())
    context = study.records[0].context
    reach = SHORT * robot_length(context)
    everything = pd.concat(designs)
    x_low, x_high, _, y = fit_window([context], everything, reach)
    pictures = [_draw(sensors, reach) if drawn else Markup() for sensors in designs]
    marks = list(_list_marks(table, records, axes, places, width, pictures, len(study.records) > 1))
    ticks = [list(_list_ticks(interval)) for interval in bounds]
    return DesignMap(
        name=name,
        axes=_name_axes(axes, with_direction=not width),
        ticks=(ticks[0], ticks[1]),
        marks=marks,
        dots=[] if dots is None else [(float(a), float(b)) for a, b in dots],
        designs=list(zip(records, numbers, strict=True)),
        data=_encode_designs(study, table, axes, designs),
        low=low,
        high=high,
        view_box=f"{-y:.3f} {-x_high:.3f} {2 * y:.3f} {x_high - x_low:.3f}",
        outline=Markup("").join(
            _OUTLINE.format(_trace(outline_part(part)), "#595959" if part.wheel else "#f7f7f7")
            for part in sorted(context.parts, key=lambda part: part.top_m)
        ),
    )


def _list_marks(
    table: pd.DataFrame,
    records: Sequence[Record],
    axes: tuple[Axis, Axis],
    places: Array,
    width: float,
    pictures: Sequence[Markup],
    several: bool,
) -> Iterator[Mark]:
    """Yield a mark for each row of the table, coloured by its share of the span of fitness.

    With ``several`` runs in the study, the name of a mark has its run.
    """
    low, high = float(table.fitness.min()), float(table.fitness.max())
    for (x, y), (_, row), record, picture in zip(
        np.round(places, 3).tolist(), table.iterrows(), records, pictures, strict=True
    ):
        title = _name(row, record, several)
        share = (row["fitness"] - low) / (high - low) if high > low else 1.0
        label = ", ".join([title, *(f"{a.label} {row[a.column]:.2f}" for a in axes)])
        playable = has_missions(record, int(row["id"]))
        yield Mark(x, y, width, width, _colour(share), title, label, playable, picture)


def _name_axes(axes: tuple[Axis, Axis], with_direction: bool) -> tuple[str, str]:
    x, y = (f"{a.label} ({BETTER[a.sign]})" if with_direction else a.label for a in axes)
    return x, y


def _name(row: "pd.Series[Any]", record: Record, several: bool) -> str:
    run = f" of {record.name}" if several else ""
    return f"design {row['id']}{run}, fitness {row['fitness']:.2f}"


def _encode_designs(
    study: Study, table: pd.DataFrame, axes: Sequence[Axis], designs: Sequence[pd.DataFrame]
) -> Markup:
    """Encode what is drawn and written beside the map of each design."""
    context = study.records[0].context
    content = {
        "parts": encode_parts(context),
        "reach": LENGTHS * robot_length(context),
        "designs": [
            {
                "run": study.records[int(row["place"])].name,
                "design": int(row["id"]),
                "values": [
                    [f"{FITNESS}, recorded", f"{row['fitness']:.3f}"],
                    *(
                        [axis.label, f"{row[axis.column]:.3f}"]
                        for axis in axes
                        if axis.label != FITNESS
                    ),
                ],
                "sensors": list(encode_sensors(sensors)),
            }
            for (_, row), sensors in zip(table.iterrows(), designs, strict=True)
        ],
    }
    return htmlsafe_json_dumps(content, separators=(",", ":"))


def _draw(sensors: pd.DataFrame, reach_m: float) -> Markup:
    """Return the cones and the places of sensors, as elements of SVG."""
    cones = "".join(_trace(cone) for cone in trace_cones(sensors, reach_m))
    dots = "".join(f"M{-y:.3f} {-x:.3f}h0" for x, y in sensors[["x_m", "y_m"]].to_numpy(float))
    return Markup('<path class="cone" d="{}"/><path class="dot" d="{}"/>').format(cones, dots)


def _trace(outline: Array) -> str:
    """Return the path of a polygon in the robot's frame: nose up, left on the left."""
    return "M" + "L".join(f"{-y:.3f} {-x:.3f}" for x, y in outline.tolist()) + "Z"


def _colour(share: float) -> str:
    return to_hex(mpl.colormaps[CMAP](share))


def _list_ticks(bounds: tuple[float, float]) -> Iterator[Tick]:
    low, high = bounds
    for value in np.asarray(MaxNLocator(5).tick_values(low, high)).tolist():
        if low - 1e-9 <= value <= high + 1e-9:
            yield Tick(round(100 * (value - low) / (high - low), 3), f"{value:g}")
