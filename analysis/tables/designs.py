"""Designs as tables: a row a sensor, in the robot's frame (x forward, y left)."""

import math
import re
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext

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
"""``pair`` numbers the placed sensors: mirrored twins share it."""


def sensors(mounts: pd.DataFrame, setting: FigureContext) -> pd.DataFrame:
    """The columns ``COLUMNS``, of mounts with the columns of ``champion/design.csv``.

    Angles are from -180 to 180. Rows of designs without sensors are left out.
    """
    frame = mounts[mounts.sensor.notna()].copy()
    frame["link"] = frame.link.astype(str)
    unknown = (set(frame.link) - set(setting.places)) | (set(frame.type) - set(setting.beams))
    if unknown:
        known = ", ".join((*setting.places, *setting.beams))
        raise InputError(
            f"design.csv: links and types must be those of setting.json ({known}), not "
            f"{', '.join(map(str, unknown))}; restore the files"
        )
    places = np.array([setting.places[link] for link in frame.link]).reshape(-1, 4)
    beams = [setting.beams[kind] for kind in frame.type]
    x, y = frame.x_m.to_numpy(float), frame.y_m.to_numpy(float)
    cos, sin = np.cos(places[:, 3]), np.sin(places[:, 3])
    frame["x_m"], frame["y_m"] = places[:, 0] + cos * x - sin * y, places[:, 1] + sin * x + cos * y
    frame["z_m"] = places[:, 2] + frame.z_m.to_numpy(float)
    turned = frame.yaw_deg.to_numpy(float) + np.degrees(places[:, 3])
    frame["yaw_deg"] = turned - 360.0 * np.ceil((turned - 180.0) / 360.0)
    frame["fov_deg"] = [beam.fov_deg for beam in beams]
    frame["range_m"] = [beam.range_max_m for beam in beams]
    frame["sensor"] = frame.sensor.astype(int)
    frame["pair"] = frame.sensor // 2 if setting.mirrored else frame.sensor
    return frame[list(COLUMNS)]


def champion_sensors(record: "Record") -> pd.DataFrame:
    """Of a run's champion, with ``fitness`` and ``validated_fitness``."""
    return sensors(record.run.champion, record.setting).assign(**_fitness(record))


def _fitness(record: "Record") -> dict[str, float]:
    columns = ("fitness", "validated_fitness")
    return {name: number(record.run.status.get(f"best_{name}")) for name in columns}


def champion_or_none(record: "Record") -> pd.DataFrame:
    """The same; a row without values, fitness apart, for a champion that has no sensors."""
    frame = champion_sensors(record)
    if len(frame):
        return frame
    missing = dict.fromkeys(("design", "sensor", "pair"), "Int64")  # stay whole beside others
    return frame.reindex([0]).assign(**_fitness(record)).astype(missing)


def generations(record: "Record") -> pd.DataFrame:
    """A row for each candidate of each generation; there must be one."""
    table = record.run.generations
    if table.empty:
        raise InputError(f"{record.path}: must have a generation, and has none; resume the run")
    return table


def initial_sensors(record: "Record") -> pd.DataFrame:
    """Of the designs of generation 0 that were made at random."""
    table = generations(record)
    first = table[(table.generation == 0) & (table.operator == "initial")].drop_duplicates("id")
    return sensors(candidate_mounts(first, record), record.setting)


def candidate_mounts(candidates: pd.DataFrame, record: "Record") -> pd.DataFrame:
    """The mounts of rows of a generation's table, twins included, as ``champion/design.csv``."""
    setting = record.setting
    placed = [_slot(candidates, slot, record) for slot in range(len(_slots(candidates)))]
    if setting.mirrored:
        placed += [each.assign(twin=1, y_m=-each.y_m, yaw_deg=-each.yaw_deg) for each in placed]
    if not placed:
        return pd.DataFrame(columns=[*COLUMNS, "link"])
    mounts = pd.concat(placed, ignore_index=True)
    order = {kind: place for place, kind in enumerate(setting.beams)}
    mounts = mounts.assign(order=mounts.type.map(order))
    mounts = mounts.sort_values(["design", "order", "slot", "twin"], ignore_index=True)
    return mounts.assign(sensor=mounts.groupby("design").cumcount())


def _slots(candidates: pd.DataFrame) -> list[str]:
    return [str(name) for name in candidates if re.fullmatch(r"sensor\d+_yaw_deg", str(name))]


def _slot(candidates: pd.DataFrame, slot: int, record: "Record") -> pd.DataFrame:
    """The sensors placed by one slot; what its region leaves open is the robot's default mount."""
    prefix = f"sensor{slot}_"
    own = candidates[[name for name in candidates if str(name).startswith((prefix, "id"))]]
    own = own.rename(columns=lambda name: "design" if name == "id" else name.removeprefix(prefix))
    own = own[own.x_m.notna()].assign(slot=slot, twin=0)
    for name in ("link", "z_m", "pitch_deg"):
        if name not in own:
            default = record.values.get(f"robot.mount.{name}")
            given = [record.values.get(f"design.regions.{region}.{name}") for region in own.region]
            own[name] = [default if value is None else value for value in given]
    return own if "type" in own else own.assign(type=next(iter(record.setting.beams), ""))


def number(value: object) -> float:
    """NaN where it is none."""
    return float(value) if isinstance(value, int | float) else math.nan
