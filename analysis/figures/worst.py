"""What stops a design: the smallest set of failed sensors, and the risk under drawn failures."""

import argparse

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, PercentFormatter

from evoros.base.errors import InputError
from evoros.failure.case import Case
from evoros.storage.figure_context import FigureContext
from evoros.storage.worst_cases import describe_worst_cases, read_worst_cases

from ..drawing.paper import spread
from ..drawing.robot import (
    AXES,
    assign_markers,
    draw_cones,
    draw_robot,
    draw_sensors,
    frame_axes,
    to_page,
)
from ..drawing.style import BLUE, PAGE_IN, VERMILLION, figure_width, is_wide, use_style
from ..drawing.words import wrap
from ..measures.cones import outline_part
from ..measures.worst_cases import (
    count_sets,
    estimate_risks,
    find_smallest,
    list_cases,
    read_set,
)
from ..product import Product
from ..tables.designs import place_sensors
from ..tables.failed_missions import KEYS, collect_missions, count_sensors
from ..tables.study import Study

ONE_ROBOT = True
HELP = "what stops a design: the smallest set of failed sensors, the probability of failure"
REACH_M = 0.25  # of the cones that are drawn, beyond the robot


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the design."""
    parser.add_argument(
        "--design", metavar="NAME", help="the design that is drawn, of several; the first one"
    )


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw one design; the tables have all designs: cases, sets by their size, and risks."""
    missions = collect_missions(study)
    sensors = dict(pair for record in study.evaluations for pair in count_sensors(record))
    missions = missions.assign(**{key: missions[key].astype(str) for key in KEYS})
    cases, risks = list_cases(missions), estimate_risks(missions)
    sets = count_sets(cases, sensors)
    key = _choose(cases, options.design)
    searched = {
        (str(source), str(design)): own
        for each in study.evaluations
        if (found := read_worst_cases(each.path)) is not None
        for (source, design), own in found.groupby(list(KEYS))
    }
    record = next(each for each in study.evaluations if key in dict(count_sensors(each)))
    mounts = record.mounts.assign(**{name: record.mounts[name].astype(str) for name in KEYS})
    placed = place_sensors(_of(mounts, *key), record.context)
    figure = draw_worst(
        _of(cases, *key),
        _of(sets, *key),
        placed,
        record.context,
        figure_width(options.columns, 2),
        searched.get(key),
    )
    messages = [
        line
        for each in sensors
        for line in describe(cases, sets, risks, *each, searched=each in searched)
    ]
    messages += [line for each in study.evaluations for line in describe_worst_cases(each.path)]
    return Product(cases, figure, messages, {"worst_sets.csv": sets, "worst_risks.csv": risks})


def _choose(cases: pd.DataFrame, wanted: str | None) -> tuple[str, str]:
    known = cases[list(KEYS)].drop_duplicates()
    chosen = known if wanted is None else known[known["design"] == wanted]
    if chosen.empty:
        names = ", ".join(dict.fromkeys(known["design"]))
        raise InputError(
            f"--design: must be a design of the evaluations, not {wanted!r}; choose one of {names}"
        )
    row = chosen.iloc[0]
    return str(row["source"]), str(row["design"])


def _of(table: pd.DataFrame, source: str, design: str) -> pd.DataFrame:
    return table[(table["source"] == source) & (table["design"] == design)]


def describe(
    cases: pd.DataFrame,
    sets: pd.DataFrame,
    risks: pd.DataFrame,
    source: str,
    design: str,
    searched: bool = False,
) -> list[str]:
    """Say what stops a design, how much was tried, how to repeat it, and the risks.

    What an evaluation that has ``searched`` for worst cases found is said by its own table.
    """
    own, name = _of(cases, source, design), f"design {design} of {source}"
    if own.empty:
        return []
    smallest, tried = find_smallest(own), _of(sets, source, design)
    lines = [
        f"{name}: without a failure, {row['stopped']} of {row['missions']} missions are not "
        f"completed"
        for row in tried[tried["failed"] == 0].to_dict("records")
    ]
    if searched:
        lines = []
    elif smallest.empty:
        extent = _describe_extent(tried)
        lines.append(f"{name}: completed with every set of failed sensors ({extent})")
    else:
        first = smallest.iloc[0]
        numbers = ",".join(map(str, read_set(first["failed_sensors"])))
        others = f", as in {len(smallest) - 1} other cases of so few" if len(smallest) > 1 else ""
        worlds = first["stopped_in"].replace(" ", ", ")
        lines.append(
            f"{name}: not completed in {worlds} with {_count(first)} failed ({numbers}) at "
            f"{first['failed_at_s']:g} s{others} ({_describe_extent(tried)}); "
            f"whether that is the failure or noise, more trials tell: failure=given "
            f"failure.sensors=[{numbers}] failure.time_s={first['failed_at_s']:g} trials=40"
        )
    lines += [
        f"{name}: under {row['evaluation']}, a trial fails with a probability of {row['risk']:.3f} "
        f"(95 % interval {row['risk_low']:.3f} to {row['risk_high']:.3f}, {row['missions']} trials)"
        for row in _of(risks[risks["world"] == ""], source, design).to_dict("records")
    ]
    return lines


def _describe_extent(tried: pd.DataFrame) -> str:
    """Say up to which number of failed sensors all sets were met."""
    most = 0
    for row in tried[tried["failed"] > 0].to_dict("records"):
        if row["failed"] != most + 1 or row["sets"] != row["of"]:
            break
        most = int(row["failed"])
    return f"all sets of up to {most} were met" if most else "not all sets were met"


def _count(case: "pd.Series[float]") -> str:
    return "1 sensor" if case["failed"] == 1 else f"{case['failed']:.0f} sensors"


def draw_worst(
    cases: pd.DataFrame,
    sets: pd.DataFrame,
    sensors: pd.DataFrame,
    context: FigureContext,
    width: float = PAGE_IN,
    searched: pd.DataFrame | None = None,
) -> Figure:
    """Draw the share of sets that stop a design by their size, and its smallest stopping set.

    ``cases`` and ``sets`` are those of one design; ``sensors`` has the columns of
    ``designs.COLUMNS``. ``width`` is in inches. ``searched`` has the rows of the design in the
    table of an evaluation that looked for worst cases; its finding takes the place of the cases.
    """
    with use_style():
        if is_wide(width):
            figure = Figure(figsize=(width, 0.42 * width), layout="constrained")
            shares, plan = figure.subplots(1, 2, width_ratios=(1.2, 1.0))
        else:
            figure = Figure(figsize=(width, 1.65 * width), layout="constrained")
            shares, plan = figure.subplots(2, 1, height_ratios=(1.0, 1.5))
        _draw_shares(shares, sets)
        failed, title = _find_met(cases) if searched is None else _find_confirmed(searched)
        _draw_plan(plan, sensors, context, failed)
        plan.set_title(wrap(title, 30))
    return figure


def _find_met(cases: pd.DataFrame) -> tuple[tuple[int, ...], str]:
    """Return the smallest set with which a mission was not completed, and what it did."""
    smallest = find_smallest(cases)
    if smallest.empty:
        return (), ""
    first = smallest.iloc[0]
    worlds = first["stopped_in"].replace(" ", ", ")
    title = f"not completed: {worlds}, failure at {first['failed_at_s']:g} s"
    return read_set(first["failed_sensors"]), title


def _find_confirmed(searched: pd.DataFrame) -> tuple[tuple[int, ...], str]:
    """Return the smallest set that stops the design on fresh draws, and what it does."""
    stopping = searched[searched["smallest"] & searched["stops"]]
    if stopping.empty:
        return (), f"stopped by none of {searched['number'].nunique() - 1} cases"
    first = stopping.iloc[0]
    case = Case.parse(str(first["case"]))
    times = ", ".join(f"{time:g}" for time in dict.fromkeys(case.times_s))
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
        some = f"{row['stopping']}/{row['sets']}\nsets"
        none = f"{row['stopped']}/{row['missions']}\nmissions"  # often few
        axes.annotate(
            some if row["failed"] else none,
            (row["failed"], row["stopped"] / row["missions"]),
            (0, 2),
            textcoords="offset points",
            ha="center",
            fontsize="small",
        )
    axes.set(ylim=(0.0, 1.2), xlabel="failed sensors", ylabel="missions not completed")
    axes.set_title(wrap("numbers: sets with a mission not completed, of those met", 40))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0])
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if not whole.all():
        handle = Patch(fc="none", ec=VERMILLION, hatch="////", label="not all sets were met")
        axes.legend(handles=[handle], frameon=False, loc="upper left")


def _draw_plan(
    axes: Axes, sensors: pd.DataFrame, context: FigureContext, failed: tuple[int, ...]
) -> None:
    draw_robot(axes, context)
    colours = [VERMILLION if number in failed else BLUE for number in sensors["sensor"]]
    draw_cones(axes, sensors, colours, REACH_M)
    draw_sensors(axes, sensors, colours, assign_markers(sensors))
    corners = [to_page(outline_part(part)) for part in context.parts]
    reach = max(float(abs(points).max()) for points in corners) + REACH_M
    frame_axes(axes, (-reach, reach, -reach, reach))
    _number_sensors(axes, sensors, failed, reach)
    axes.set(xlabel=AXES[0], ylabel=AXES[1])
    kinds = [(VERMILLION, "failed"), (BLUE, "works")] if failed else [(BLUE, "sensor")]
    handles = [Patch(fc=colour, alpha=0.6, label=label) for colour, label in kinds]
    axes.legend(handles=handles, frameon=False, loc="lower center", ncols=2)


def _number_sensors(
    axes: Axes, sensors: pd.DataFrame, failed: tuple[int, ...], reach: float
) -> None:
    """Write the numbers of the sensors at both sides of the robot, with lines to them."""
    apart = 0.14 * reach
    for side in (1.0, -1.0):
        own = sensors[(sensors["y_m"] >= 0.0) == (side > 0.0)].sort_values("x_m")
        levels = spread(own["x_m"].tolist(), apart)
        for row, level in zip(own.to_dict("records"), levels, strict=True):
            end = side * 0.85 * reach
            axes.plot([row["y_m"], end], [row["x_m"], level], color="0.3", lw=0.4, zorder=3)
            axes.text(
                end,
                level,
                f" {row['sensor']} ",
                fontsize="small",
                weight="bold" if row["sensor"] in failed else "normal",
                ha="right" if side > 0 else "left",
                va="center",
            )
