"""Designs of runs and evaluations, as readable tables of sensors."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import pandas as pd

from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.storage.figure_context import FigureContext

from . import designs
from .agents import list_robots
from .champions import BEST_SO_FAR, find_shown
from .loading import load_study
from .records import EvaluationRecord, Record
from .tracks import select_robot

COLUMNS = (
    *("sensor", "type", "link", "x_m", "y_m", "z_m", "yaw_deg", "pitch_deg"),
    *("fov_deg", "range_m", "price"),
)


@dataclass(frozen=True, eq=False)
class ShownDesign:
    """A design of one robot, with sensor poses in the robot's frame."""

    title: str
    name: str  # number or name of the design
    rays: pd.DataFrame  # see ``place_sensors``
    signals: pd.DataFrame  # see ``place_signals``
    sensors: pd.DataFrame  # one row per sensor, with ``COLUMNS``
    evolved: Mapping[str, float]  # evolved values by key, except mounts
    context: FigureContext


def show_design(
    title: str,
    name: str,
    mounts: pd.DataFrame,
    evolved: Mapping[str, float],
    context: FigureContext,
) -> ShownDesign:
    """Place the sensors of a design; ``mounts`` has the columns of ``champion/design.csv``."""
    context = designs.adapt_types(context, evolved)
    rays, signals = designs.place_sensors(mounts, context), designs.place_signals(mounts, context)
    prices = {name: kind.price for name, kind in context.beams.items()}
    prices |= {name: kind.price for name, kind in context.signals.items()}
    links = mounts.dropna(subset="sensor").astype({"sensor": int}).set_index("sensor").link
    sensors = pd.concat([frame for frame in (rays, signals) if len(frame)] or [rays])
    sensors = sensors.sort_values("sensor", ignore_index=True)
    sensors["link"] = sensors.sensor.map(links)
    sensors["price"] = sensors.type.map(prices)
    columns = sensors.reindex(columns=list(COLUMNS))
    return ShownDesign(title, name, rays, signals, columns, evolved, context)


def show_named(
    source: str, name: str, design: Design, context: FigureContext
) -> Iterator[ShownDesign]:
    """Yield a design for each robot; ``context`` belongs to the main robot and includes agents."""
    for robot, part in design.parts.items():
        mounts = pd.DataFrame(
            [
                {**asdict(mount), "design": name, "sensor": i, "type": mount.sensor}
                for i, mount in enumerate(part.mounts)
            ],
            columns=["design", *COLUMNS[:8]],
        )
        title = f"{source}{f'{robot}, ' if robot else ''}design {name}"
        seen = context.agents[robot] if robot else context
        yield show_design(title, name, mounts, part.values, seen)


def find_shown_designs(folder: Path, design: str | None = None) -> list[ShownDesign]:
    """Find champions of runs and designs of evaluations, all or by name; raise if none exist."""
    study = load_study([folder])
    shown = [found for record in study.records for found in _show_run(record, design)]
    shown += [found for record in study.evaluations for found in _show_given(record, design)]
    if not shown:
        raise InputError(
            f"--design {design}: no run or evaluation in {folder} has this design; "
            f"fitness.csv of evoros analyze fitness lists the designs of a run"
        )
    return shown


def _show_run(record: Record, design: str | None) -> Iterator[ShownDesign]:
    number = find_shown(record) if design is None else _parse(design)
    for robot in list_robots(record):
        if number is None:  # a champion
            mounts, genes = select_robot(robot.run.champion), select_robot(robot.run.genes)
            evolved = dict(zip(genes.key.astype(str), genes.value.astype(float), strict=True))
            name = str(mounts.design.iloc[0])
            label = f"design {name}, the champion"
        else:
            generations = designs.read_generations(robot)
            row = generations[generations.id == number].iloc[:1]
            if row.empty:
                return
            mounts, evolved = designs.list_mounts(row, robot), designs.read_evolved(robot, number)
            name = str(number)
            label = f"design {name}{f', {BEST_SO_FAR}' if design is None else ''}"
            label += f", fitness {row.fitness.iloc[0]:.4g}"
        yield show_design(_write_title(robot, label), name, mounts, evolved, robot.context)


def _show_given(record: EvaluationRecord, design: str | None) -> Iterator[ShownDesign]:
    for robot in list_robots(record):
        tables = select_robot(record.mounts, robot.agent), select_robot(record.genes, robot.agent)
        for (source, name), mounts in tables[0].groupby(["source", "design"], sort=False):
            if design not in (None, str(name)):
                continue
            genes = tables[1][(tables[1].source == source) & (tables[1].design == name)]
            evolved = dict(zip(genes.key.astype(str), genes.value.astype(float), strict=True))
            title = _write_title(robot, f"design {name} of {source}")
            yield show_design(title, str(name), mounts, evolved, robot.context)


def _parse(design: str) -> int:
    if not design.isdecimal():
        raise InputError(f"--design {design}: must be the number of a design; correct the number")
    return int(design)


def _write_title(robot: Record, label: str) -> str:
    return f"{robot.name}{f', {robot.agent}' if robot.agent else ''}: {label}"
