"""Sensor failures that stop a design: the smallest set, and the risk from random failures."""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import PercentFormatter

from evoros.base.errors import InputError
from evoros.failure.protocol import Case
from evoros.storage.figure_context import FigureContext
from evoros.storage.layout import name_parts
from evoros.storage.reading import read_overrides, read_worst_cases
from evoros.worst_cases.summary import describe_worst_cases

from ..designs.cones import outline_part
from ..drawing import robot
from ..drawing.paper import label_sensors
from ..drawing.style import BLUE, PAGE_IN, VERMILLION, figure_width, is_wide, use_style, wrap
from ..statistics.worst_cases import (
    KEYS,
    collect_missions,
    count_sensors,
    count_sets,
    estimate_risks,
    find_smallest,
    list_cases,
    read_set,
)
from ..subcommands import Product
from ..tables.designs import place_sensors
from ..tables.study import Study

ONE_ROBOT = True
HELP = "the smallest set of failed sensors that stops a design, and the risk of failure"
NEEDS = "evaluations in one simulator"
FILES = ("worst.csv", "worst_sets.csv", "worst_risks.csv")
REACH_M = 0.25  # length [m] of the drawn cones


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--design``."""
    about = "the design to draw; default: the first one"
    parser.add_argument("--design", metavar="NAME", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw one design; tables list the cases, the sets by size, and the risks of all designs."""
    missions = collect_missions(study)
    counts = dict(pair for record in study.evaluations for pair in count_sensors(record))
    cases, risks = list_cases(missions), estimate_risks(missions)
    sets = count_sets(cases, counts)
    tables = {
        record.path: table
        for record in study.evaluations
        if (table := read_worst_cases(record.path)) is not None
    }
    searched = {key: rows for table in tables.values() for key, rows in table.groupby(list(KEYS))}
    designs = {}
    for key in counts:
        tables_of_design = (_of(cases, key), _of(sets, key), _of(risks, key), searched.get(key))
        designs[key] = _TestedDesign(f"design {key[1]} of {key[0]}", *tables_of_design)
    key = _choose(cases, options.design)
    record = next(record for record in study.evaluations if key in dict(count_sensors(record)))
    placed = place_sensors(_of(record.mounts.astype(dict.fromkeys(KEYS, str)), key), record.context)
    width = figure_width(options.columns, 2)
    name = f"design {key[1]} of\n{Path(key[0]).name}" if len(designs) > 1 else ""
    figure = _draw_worst(designs[key], placed, record.context, width, name)
    messages = [line for design in designs.values() for line in design.describe()]
    for path, table in tables.items():
        messages += describe_worst_cases(table, read_overrides(path), name_parts(path))
    return Product(cases, figure, messages, {"worst_sets.csv": sets, "worst_risks.csv": risks})


def _choose(cases: pd.DataFrame, wanted: str | None) -> tuple[str, str]:
    known = cases[list(KEYS)].drop_duplicates()
    chosen = known if wanted is None else known[known["design"] == wanted]
    if chosen.empty:
        names = ", ".join(dict.fromkeys(known["design"]))
        raise InputError(
            f"--design: {wanted!r} is not a design of the evaluations; choose one of {names}"
        )
    row = chosen.iloc[0]
    return str(row["source"]), str(row["design"])


def _of(table: pd.DataFrame, key: tuple[str, str]) -> pd.DataFrame:
    return table[(table["source"] == key[0]) & (table["design"] == key[1])]


@dataclass(frozen=True, eq=False)
class _TestedDesign:
    name: str
    cases: pd.DataFrame
    sets: pd.DataFrame
    risks: pd.DataFrame
    searched: pd.DataFrame | None  # rows from a search for worst cases; None if there was none

    def describe(self) -> Iterator[str]:
        if self.cases.empty:
            return
        if self.searched is None:
            for row in self.sets[self.sets["failed"] == 0].to_dict("records"):
                missions = f"{row['stopped']} of {row['missions']} missions"
                yield f"{self.name}: without a failure, {missions} are not completed"
            yield f"{self.name}: {self._describe_smallest()}"
        for row in self.risks[self.risks["world"] == ""].to_dict("records"):
            yield (
                f"{self.name}: in {row['evaluation']}, a trial fails with a probability of "
                f"{row['risk']:.3f} (95 % interval {row['risk_low']:.3f} to "
                f"{row['risk_high']:.3f}, {row['missions']} trials)"
            )

    def _describe_smallest(self) -> str:
        smallest, extent = find_smallest(self.cases), self._describe_extent()
        if smallest.empty:
            return f"completed with every set of failed sensors tried ({extent})"
        first = smallest.iloc[0]
        numbers = ",".join(map(str, read_set(first["failed_sensors"])))
        others = f"; other cases of this size: {len(smallest) - 1}" if len(smallest) > 1 else ""
        worlds = first["stopped_in"].replace(" ", ", ")
        sensors = f"{first['failed']:.0f} sensor{'' if first['failed'] == 1 else 's'}"
        return (
            f"not completed in {worlds} with {sensors} failed ({numbers}) at "
            f"{first['failed_at_s']:g} s{others} ({extent}); "
            f"to tell failure from noise, repeat this case with failure=given "
            f"failure.sensors=[{numbers}] failure.time_s={first['failed_at_s']:g} trials=40"
        )

    def _describe_extent(self) -> str:
        most = 0
        for row in self.sets[self.sets["failed"] > 0].to_dict("records"):
            if row["failed"] != most + 1 or row["sets"] != row["of"]:
                break
            most = int(row["failed"])
        return f"all sets of up to {most} were tried" if most else "not all sets were tried"


def _draw_worst(
    design: _TestedDesign,
    sensors: pd.DataFrame,
    context: FigureContext,
    width: float = PAGE_IN,
    name: str = "",
) -> Figure:
    with use_style():
        wide = is_wide(width)
        figure = Figure(figsize=(width, (0.5 if wide else 1.7) * width), layout="constrained")
        if wide:
            shares, plan = figure.subplots(1, 2, width_ratios=(1.2, 1.0))
        else:
            shares, plan = figure.subplots(2, 1, height_ratios=(1.0, 1.5))
        _draw_shares(shares, design.sets)
        searched = design.searched
        failed, title = _find_met(design.cases) if searched is None else _find_confirmed(searched)
        _draw_plan(plan, sensors, context, failed)
        plan.set_title(wrap(title, 30))
        if name:
            figure.suptitle(name, fontsize="small")
        if failed:  # below the panel, where no cone is
            kinds = ((VERMILLION, "failed"), (BLUE, "working"))
            handles = [Patch(fc=colour, alpha=0.6, label=label) for colour, label in kinds]
            figure.legend(handles=handles, frameon=False, loc="outside lower right", ncols=2)
    return figure


def _find_met(cases: pd.DataFrame) -> tuple[tuple[int, ...], str]:
    smallest = find_smallest(cases)
    if smallest.empty:
        return (), ""
    first = smallest.iloc[0]
    worlds = first["stopped_in"].replace(" ", ", ")
    title = f"not completed: {worlds}, failure at {first['failed_at_s']:.1f} s"
    return read_set(first["failed_sensors"]), title


def _find_confirmed(searched: pd.DataFrame) -> tuple[tuple[int, ...], str]:
    stopping = searched[searched["smallest"] & searched["stops"]]
    if stopping.empty:
        return (), f"stopped by none of {searched['number'].nunique() - 1} cases"
    first = stopping.iloc[0]
    case = Case.parse(str(first["case"]))
    times = ", ".join(f"{time:.1f}" for time in dict.fromkeys(case.times_s))
    rate, low, high = (100 * first[name] for name in ("rate", "low", "high"))
    title = (
        f"{first['world']}: completed {rate:.0f} % ({low:.0f} to {high:.0f}), failure at {times} s"
    )
    return case.sensors, title


def _draw_shares(axes: Axes, sets: pd.DataFrame) -> None:
    whole = sets["sets"] == sets["of"]
    bars = axes.bar(sets["failed"], sets["stopped"] / sets["missions"], color=VERMILLION, width=0.7)
    for bar, complete in zip(bars, whole, strict=True):
        if not complete:
            bar.set(facecolor="none", edgecolor=VERMILLION, hatch="////")
    for row in sets.to_dict("records"):
        text, place = f"{row['stopped']}/{row['missions']}", row["stopped"] / row["missions"]
        style: dict[str, Any] = {"textcoords": "offset points", "ha": "center"}
        axes.annotate(text, (row["failed"], place), (0, 2), fontsize="small", **style)
    axes.set(ylim=(0.0, 1.2), ylabel="missions not completed")
    axes.set_xlabel("number of failed sensors\n(sets that stopped a mission / all sets)")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0])
    labels = [f"{row.failed}\n({row.stopping}/{row.sets})" for row in sets.itertuples()]
    axes.set_xticks(sets["failed"], labels)
    if not whole.all():
        handle = Patch(fc="none", ec=VERMILLION, hatch="////", label="not all sets occurred")
        axes.legend(handles=[handle], frameon=False, loc="upper left")


def _draw_plan(
    axes: Axes, sensors: pd.DataFrame, context: FigureContext, failed: tuple[int, ...]
) -> None:
    robot.draw_robot(axes, context)
    colours = [VERMILLION if sensor in failed else BLUE for sensor in sensors["sensor"]]
    robot.draw_cones(axes, sensors, colours, REACH_M)
    robot.draw_sensors(axes, sensors, colours, robot.assign_markers(sensors))
    corners = [robot.to_page(outline_part(part)) for part in context.parts]
    reach = max(float(abs(points).max()) for points in corners) + REACH_M
    edge = 1.15 * reach
    robot.frame_axes(axes, (-reach, reach, -edge, edge))
    labels = sensors.assign(label=sensors["sensor"], bold=sensors["sensor"].isin(failed))
    label_sensors(axes, labels, reach, 0.14 * reach)
    axes.set(xlabel=robot.AXES[0], ylabel=robot.AXES[1])
