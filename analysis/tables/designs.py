"""Designs as tables: a row for each sensor, in the robot's frame (x forward, y left)."""

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.figure_context import Beam, FigureContext

if TYPE_CHECKING:
    from .records import Record

COLUMNS = (
    "design",
    "sensor",
    "type",
    "x_m",
    "y_m",
    "z_m",
    "yaw_deg",
    "pitch_deg",
    "fov_deg",
    "range_m",
    "pair",
)
"""``pair`` numbers the placed sensors; mirrored twins share it."""


def place_sensors(mounts: pd.DataFrame, context: FigureContext) -> pd.DataFrame:
    """Transform mounts from the frames of their links to the robot's frame.

    ``mounts`` has the columns of ``champion/design.csv``; the table returned has ``COLUMNS``.
    Angles are from -180 to 180. Rows of designs without sensors are dropped.

    Raises:
        InputError: a link or type is not in the context.
    """
    frame = mounts[mounts.sensor.notna()].copy()
    frame["link"] = frame.link.astype(str)
    unknown = (set(frame.link) - set(context.places)) | (set(frame.type) - set(context.beams))
    if unknown:
        known = ", ".join((*context.places, *context.beams))
        raise InputError(
            f"design.csv: links and types must be those of setting.json ({known}), not "
            f"{', '.join(map(str, unknown))}; restore the files"
        )
    links = np.array([context.places[link] for link in frame.link]).reshape(-1, 4)
    beams = [context.beams[kind] for kind in frame.type]
    x, y = frame.x_m.to_numpy(float), frame.y_m.to_numpy(float)
    cos, sin = np.cos(links[:, 3]), np.sin(links[:, 3])
    frame["x_m"], frame["y_m"] = links[:, 0] + cos * x - sin * y, links[:, 1] + sin * x + cos * y
    frame["z_m"] = links[:, 2] + frame.z_m.to_numpy(float)
    yaw = frame.yaw_deg.to_numpy(float) + np.degrees(links[:, 3])
    frame["yaw_deg"] = yaw - 360.0 * np.ceil((yaw - 180.0) / 360.0)
    frame["fov_deg"] = [beam.fov_deg for beam in beams]
    frame["range_m"] = [beam.range_max_m for beam in beams]
    frame["sensor"] = frame.sensor.astype(int)
    frame["pair"] = frame.sensor // 2 if context.mirrored else frame.sensor
    return frame[list(COLUMNS)]


def read_champion_sensors(record: "Record") -> pd.DataFrame:
    """Read the sensors of a run's champion, with ``fitness`` and ``validated_fitness``."""
    context = replace(record.context, beams=read_champion_beams(record))
    return place_sensors(record.run.champion, context).assign(**_fitness(record))


def read_champion_beams(record: "Record") -> dict[str, Beam]:
    """Read the field of view and the range of each type of sensor, as the champion evolved them."""
    genes = record.run.genes
    evolved = dict(zip(genes.key.astype(str), genes.value.tolist(), strict=True))
    return {
        kind: _adapt_beam(beam, f"design.sensors.{kind}.", evolved)
        for kind, beam in record.context.beams.items()
    }


def _adapt_beam(beam: Beam, prefix: str, values: Mapping[str, float]) -> Beam:
    names = ("fov_deg", "range_min_m", "range_max_m")
    changed = {name: float(values[f"{prefix}{name}"]) for name in names if prefix + name in values}
    wider = changed.get("fov_deg", beam.fov_deg) / beam.fov_deg if beam.fov_deg else 1.0
    bearings = tuple(wider * bearing for bearing in beam.bearings_deg)
    return replace(beam, bearings_deg=bearings, **changed)


def _fitness(record: "Record") -> dict[str, float]:
    columns = ("fitness", "validated_fitness")
    return {name: to_number(record.run.status.get(f"best_{name}")) for name in columns}


def read_champion(record: "Record") -> pd.DataFrame:
    """Read the champion's sensors, or one row with fitness alone if it has no sensors."""
    frame = read_champion_sensors(record)
    if len(frame):
        return frame
    missing = dict.fromkeys(("design", "sensor", "pair"), "Int64")  # integers beside other runs
    return frame.reindex([0]).assign(**_fitness(record)).astype(missing)


def read_generations(record: "Record") -> pd.DataFrame:
    """Read a row for each candidate of each generation.

    Raises:
        InputError: no generation is finished.
    """
    table = record.run.generations
    if table.empty:
        raise InputError(
            f"{record.path}: must have a finished generation, but has none; resume the run"
        )
    return table


def read_initial_sensors(record: "Record") -> pd.DataFrame:
    """Read the sensors of the random designs of generation 0."""
    table = read_generations(record)
    first = table[(table.generation == 0) & (table.operator == "initial")].drop_duplicates("id")
    return place_sensors(list_mounts(first, record), record.context)


def list_mounts(candidates: pd.DataFrame, record: "Record") -> pd.DataFrame:
    """List the mounts of candidates, twins included, with the columns of ``design.csv``.

    ``candidates`` has rows of a generation's table.
    """
    placed = [_slot(candidates, slot, record) for slot in range(len(_slots(candidates)))]
    if record.context.mirrored:
        placed += [mount.assign(twin=1, y_m=-mount.y_m, yaw_deg=-mount.yaw_deg) for mount in placed]
    if not placed:
        return pd.DataFrame(columns=[*COLUMNS, "link"])
    mounts = pd.concat(placed, ignore_index=True)
    order = {kind: number for number, kind in enumerate(record.context.beams)}
    mounts = mounts.assign(order=mounts.type.map(order))
    mounts = mounts.sort_values(["design", "order", "slot", "twin"], ignore_index=True)
    return mounts.assign(sensor=mounts.groupby("design").cumcount())


def _slots(candidates: pd.DataFrame) -> list[str]:
    return [str(name) for name in candidates if re.fullmatch(r"sensor\d+_yaw_deg", str(name))]


def _slot(candidates: pd.DataFrame, slot: int, record: "Record") -> pd.DataFrame:
    """List the sensors of one slot; values without a column are those of their region."""
    prefix = f"sensor{slot}_"
    mounts = candidates[[name for name in candidates if str(name).startswith((prefix, "id"))]]
    mounts = mounts.rename(
        columns=lambda name: "design" if name == "id" else name.removeprefix(prefix)
    )
    mounts = mounts[mounts.x_m.notna()].assign(slot=slot, twin=0)
    areas = [record.context.regions[region] for region in mounts.region]
    mounts = mounts.assign(link=[area.link for area in areas])
    for name in ("z_m", "pitch_deg"):
        if name not in mounts:  # constant in each region
            mounts[name] = [getattr(area, name)[0] for area in areas]
    return mounts if "type" in mounts else mounts.assign(type=next(iter(record.context.beams), ""))


def to_number(value: object) -> float:
    """Convert a value to a float; anything but a number becomes NaN."""
    return float(value) if isinstance(value, int | float) else math.nan
