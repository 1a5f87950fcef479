"""The archive and the front of a study as maps in the page, whose marks choose a design.

A mark is a cell of the archive or a point of the front. Its design is drawn beside the map, and its
missions can be played if the run has kept them.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup
from matplotlib.ticker import MaxNLocator

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext

from ..designs.cones import fit_window, robot_length
from ..drawing.cells import LENGTHS as SHORT
from ..drawing.gallery import LENGTHS
from ..figures.options import TREATMENT, group_runs
from ..subcommands import parse
from ..tables.agents import choose_robot
from ..tables.candidates import place_candidates
from ..tables.elites import read_archive, read_front
from ..tables.measured import Axis
from ..tables.shown import has_missions
from ..tables.study import Study
from .design_map import DesignMap, Mark, Tick, colour_share
from .ground import encode_parts, encode_sensors
from .pictures import draw_outline, draw_sensors

MOST_DRAWN = 18
"""Maximum number of cells along a descriptor into which designs are drawn."""
MOST_DOTS = 3000
MARGIN = 0.06  # of a front around its points, as a share of its width
FITNESS = "fitness"
BETTER = {1.0: "more is better", -1.0: "less is better"}
TITLES = {"archive": "Archive", "front": "Front"}


def make_maps(study: Study, options: argparse.Namespace) -> dict[str, DesignMap]:
    """Make the maps for which the runs have recorded measures, of the first robot, by key.

    Each treatment has a map of its own, as in the figures, in the same axes and colours.
    """
    makers = {"archive": _map_archive, "front": _map_front}
    maps: dict[str, DesignMap] = {}
    first = choose_robot(study, None).study
    groups = group_runs(first, TREATMENT)
    for name, make in makers.items():
        try:
            ground, select = make(first, parse([name, *map(str, options.folders)]))
        except InputError:
            continue  # the section of its figure says why
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
    """The designs of a map, and where they are."""

    table: pd.DataFrame
    places: Array  # (n, 2), in percent
    dots: Sequence[tuple[float, float]] = ()  # of other designs, in percent


class _Ground(NamedTuple):
    """The axes of a map, and the looks of its marks."""

    name: str
    axes: tuple[Axis, Axis]
    bounds: Sequence[tuple[float, float]]
    width: float = 0.0  # of a mark, in percent; 0: marks are points
    drawn: bool = False  # whether marks have pictures

    @property
    def labels(self) -> tuple[str, str]:
        """The labels of the axes, which tell which direction is better for points."""
        x, y = (a.label if self.width else f"{a.label} ({BETTER[a.sign]})" for a in self.axes)
        return x, y


Maker = tuple[_Ground, Callable[[Sequence[int]], _Content]]
"""The axes of a map, and the function that selects the designs of some runs."""


def _map_archive(study: Study, options: argparse.Namespace) -> Maker:
    archive = read_archive(study, options)
    x, y, cells = archive.grid
    width = 100 / cells

    def select(runs: Sequence[int]) -> _Content:
        elites = archive.select_elites(runs)
        return _Content(elites, elites[["cell_x", "cell_y"]].to_numpy(float) * width)

    drawn = cells <= MOST_DRAWN
    return _Ground("archive", (x, y), (x.bounds, y.bounds), width, drawn), select


def _map_front(study: Study, options: argparse.Namespace) -> Maker:
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
        return _Content(
            front, _to_percent(front[columns], bounds), [(across, up) for across, up in dots]
        )

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
    """Make a map of designs, coloured on a scale of fitness, on the robot of ``context``."""
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
        picture=pictures, colour=shares.map(colour_share), record=pd.Series(records, table.index)
    )
    return DesignMap(
        name=ground.name,
        axes=ground.labels,
        ticks=(x_ticks, y_ticks),
        marks=list(_list_marks(marked, content.places, ground)),
        dots=list(content.dots),
        designs=[(record, int(design)) for record, design in zip(records, table.id, strict=True)],
        data=_encode_designs(marked, ground.axes, designs, context),
        low=low,
        high=high,
        view_box=f"{-side:.3f} {-x_high:.3f} {2 * side:.3f} {x_high - x_low:.3f}",
        outline=draw_outline(context),
    )


def _list_marks(table: pd.DataFrame, places: Array, ground: _Ground) -> Iterator[Mark]:
    """Yield the mark of each design; if the designs are of several runs, its name has the run."""
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
    """Encode the picture and the text of each design beside the map."""
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
