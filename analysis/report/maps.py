"""Maps of a study's archive and Pareto front, with markers that select designs on the page."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
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
from evoros.storage.figure_context import FigureContext

from ..designs.cones import fit_window, robot_length
from ..drawing.gallery import LENGTHS, SHORT
from ..figures.options import TREATMENT, group_runs
from ..subcommands import parse
from ..tables.agents import choose_robot
from ..tables.designs import place_candidates
from ..tables.elites import Axis, read_archive, read_front
from ..tables.records import Record
from ..tables.shown import has_missions
from ..tables.study import Study
from .frame import draw_outline, draw_sensors
from .playback import encode_parts, encode_sensors

_CMAP = "viridis"


class Mark(NamedTuple):
    """A cell or point of a map; position and size in percent of the map, from the lower left."""

    x: float
    y: float
    width: float  # 0 for points
    height: float
    colour: str
    name: str
    label: str  # name and position
    playable: bool
    picture: Markup  # may be empty


class Tick(NamedTuple):
    """A number on an axis, at position ``at`` in percent of the axis."""

    at: float
    text: str


@dataclass(frozen=True)
class DesignMap:
    """A map of an archive or a front on the page, with markers that select designs."""

    name: str  # name of the figure
    axes: tuple[str, str]
    ticks: tuple[list[Tick], list[Tick]]
    marks: list[Mark]
    dots: Sequence[Sequence[float]]  # positions of other designs, in percent
    designs: list[tuple[Record, int]]  # one per marker
    data: Markup  # all designs, as JSON
    low: float  # fitness at the lower end of the colour scale
    high: float
    view_box: str  # common to all pictures
    outline: Markup  # outline of the robot, common to all pictures
    key: str = ""  # identifies the map on the page
    title: str = ""  # treatment, if the study has several
    runs: int = 1  # number of runs with designs on the map

    @property
    def points(self) -> Any:
        """The marker positions (n, 2), for ``choose_apart``."""
        return np.array([(mark.x, mark.y) for mark in self.marks])

    @property
    def corner(self) -> list[str]:
        """The four numbers in ``view_box``."""
        return self.view_box.split()

    @property
    def scale(self) -> str:
        """The colours of the scale from low to high fitness."""
        return ", ".join(_colour_share(place / 8) for place in range(9))

    @property
    def played(self) -> int:
        """The number of designs with stored missions."""
        return sum(mark.playable for mark in self.marks)


def _colour_share(share: float) -> str:
    return to_hex(mpl.colormaps[_CMAP](share))


MOST_DRAWN = 18  # number of cells along a descriptor above which cells show no designs
MOST_DOTS = 3000
MARGIN = 0.06  # margin around the points of a front, as a fraction of its width
FITNESS = "fitness"
TITLES = {"archive": "Archive", "front": "Front"}


def make_maps(study: Study, options: argparse.Namespace) -> dict[str, DesignMap]:
    """Make maps of designs per figure and treatment, by key."""
    makers = {"archive": _map_archive, "front": _map_front}
    maps: dict[str, DesignMap] = {}
    first = choose_robot(study, None).study
    groups = group_runs(first, TREATMENT)
    for name, make in makers.items():
        try:
            ground, select = make(first, parse([name, *map(str, options.folders)]))
        except InputError:
            continue  # the figure's section reports the reason
        contents = {treatment: select(runs) for treatment, runs in groups.items()}
        fitness = pd.concat([content.table.fitness for content in contents.values()])
        scale = float(fitness.min()), float(fitness.max())
        for i, (treatment, content) in enumerate(contents.items(), start=1):
            alone = len(groups) == 1
            key, title = (name, "") if alone else (f"{name}-{i}", treatment)
            runs = [first.records[place] for place in groups[treatment]]
            made = _make_map(first, content, ground, scale, runs[0].context)
            maps[key] = replace(made, key=key, title=title, runs=len(runs))
    return maps


class _Content(NamedTuple):
    table: pd.DataFrame
    places: Array  # (n, 2), in percent
    dots: Sequence[Sequence[float]] = ()  # positions of other designs, in percent


class _Ground(NamedTuple):
    name: str
    axes: tuple[Axis, Axis]
    bounds: Sequence[tuple[float, float]]
    width: float = 0.0  # width of markers in percent; 0 for points
    drawn: bool = False  # whether markers contain pictures of designs

    @property
    def labels(self) -> tuple[str, str]:
        x, y = (axis.label if self.width else axis.directed_label for axis in self.axes)
        return x, y


Made = tuple[_Ground, Callable[[Sequence[int]], _Content]]  # axes, and designs of given runs


def _map_archive(study: Study, options: argparse.Namespace) -> Made:
    archive = read_archive(study, options)
    x, y, cells = archive.grid
    width = 100 / cells

    def select(runs: Sequence[int]) -> _Content:
        elites = archive.select_elites(runs)
        return _Content(elites, elites[["cell_x", "cell_y"]].to_numpy(float) * width)

    drawn = cells <= MOST_DRAWN
    return _Ground("archive", (x, y), (x.bounds, y.bounds), width, drawn), select


def _map_front(study: Study, options: argparse.Namespace) -> Made:
    shown = read_front(study, options)
    x, y, candidates = shown.x, shown.y, shown.candidates
    columns = [x.column, y.column]
    everything = candidates[columns].to_numpy(float)
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = MARGIN * np.where(high > low, high - low, 1.0)
    bounds = tuple(zip((low - margin).tolist(), (high + margin).tolist(), strict=True))

    def select(runs: Sequence[int]) -> _Content:
        front = shown.select_front(runs)
        places = _to_percent(candidates.loc[candidates.place.isin(runs), columns], bounds)
        dots = np.unique(np.round(places, 1), axis=0)[:MOST_DOTS].tolist()
        return _Content(front, _to_percent(front[columns], bounds), dots)

    return _Ground("front", (x, y), bounds), select


def _to_percent(points: Any, bounds: Sequence[tuple[float, float]]) -> Array:
    low, high = np.array(bounds).T
    shares: Array = 100 * (np.asarray(points, dtype=float) - low) / (high - low)
    return shares


def _make_map(
    study: Study,
    content: _Content,
    ground: _Ground,
    scale: tuple[float, float],
    context: FigureContext,
) -> DesignMap:
    table = content.table
    records = [study.records[int(place)] for place in table.place]
    designs = [
        place_candidates(table.loc[[row]], record)
        for row, record in zip(table.index, records, strict=True)
    ]
    reach = SHORT * robot_length(context)
    x_low, x_high, _, side = fit_window([context], pd.concat(designs), reach)
    x_ticks, y_ticks = (list(_list_ticks(interval)) for interval in ground.bounds)
    low, high = scale
    shares = (table.fitness - low) / (high - low) if high > low else table.fitness * 0.0 + 1.0
    pictures = [draw_sensors(sensors, reach) if ground.drawn else Markup() for sensors in designs]
    marked = table.assign(
        picture=pictures, colour=shares.map(_colour_share), record=pd.Series(records, table.index)
    )
    return DesignMap(
        name=ground.name,
        axes=ground.labels,
        ticks=(x_ticks, y_ticks),
        marks=list(_list_marks(marked, content.places, ground)),
        dots=content.dots,
        designs=[(record, int(design)) for record, design in zip(records, table.id, strict=True)],
        data=_encode_designs(marked, ground.axes, designs, context),
        low=low,
        high=high,
        view_box=f"{-side:.3f} {-x_high:.3f} {2 * side:.3f} {x_high - x_low:.3f}",
        outline=draw_outline(context),
    )


def _list_marks(table: pd.DataFrame, places: Array, ground: _Ground) -> Iterator[Mark]:
    several = table.place.nunique() > 1
    for row, (x, y) in zip(table.to_dict("records"), places.round(3).tolist(), strict=True):
        run = f" of {row['record'].name}" if several else ""
        name = f"design {row['id']}{run}, fitness {row['fitness']:.2f}"
        label = ", ".join([name, *(f"{a.label} {row[a.column]:.2f}" for a in ground.axes)])
        looks = row["colour"], name, label, has_missions(row["record"], row["id"]), row["picture"]
        yield Mark(x, y, ground.width, ground.width, *looks)


def _encode_designs(
    table: pd.DataFrame,
    axes: Sequence[Axis],
    designs: Sequence[pd.DataFrame],
    context: FigureContext,
) -> Markup:
    shown = [axis for axis in axes if axis.label != FITNESS]
    encoded = [
        {
            "run": row["record"].name,
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


def _list_ticks(bounds: tuple[float, float]) -> Iterator[Tick]:
    low, high = bounds
    for value in np.asarray(MaxNLocator(5).tick_values(low, high)).tolist():
        if low - 1e-9 <= value <= high + 1e-9:
            yield Tick(round(100 * (value - low) / (high - low), 3), f"{value:g}")
