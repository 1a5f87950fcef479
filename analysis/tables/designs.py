"""Tables of designs: one row per sensor, in the robot's frame (x forward, y left)."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.figure_context import Beam, FigureContext

COLUMNS = (
    *("design", "sensor", "type", "x_m", "y_m", "z_m", "yaw_deg", "pitch_deg"),
    *("fov_deg", "range_m", "pair"),
)
"""``pair`` numbers the placed sensors; mirrored twins share a number."""
SIGNAL_COLUMNS = (*COLUMNS[:8], "measures", "width_m", "depth_m")
"""Columns of sensors that cast no rays; the last two are a bumper's zone, otherwise 0."""
TYPES = "design.sensors."  # prefix of the keys of sensor types


def place_sensors(mounts: pd.DataFrame, context: FigureContext) -> pd.DataFrame:
    """Return the sensors that cast rays, with ``COLUMNS``, in the robot's frame.

    ``mounts`` has the columns of ``champion/design.csv``. Angles are in (-180, 180]. Designs
    without sensors have no rows.
    """
    frame = _transform_mounts(mounts, context)
    frame = frame[frame.type.isin(context.beams)].copy()
    frame["fov_deg"] = [context.beams[kind].fov_deg for kind in frame.type]
    frame["range_m"] = [context.beams[kind].range_max_m for kind in frame.type]
    return frame[list(COLUMNS)]


def place_signals(mounts: pd.DataFrame, context: FigureContext) -> pd.DataFrame:
    """Return the sensors that cast no rays, with ``SIGNAL_COLUMNS``; see ``place_sensors``."""
    frame = _transform_mounts(mounts, context)
    frame = frame[frame.type.isin(context.signals)].copy()
    for name in SIGNAL_COLUMNS[-3:]:
        frame[name] = [getattr(context.signals[kind], name) for kind in frame.type]
    return frame[list(SIGNAL_COLUMNS)]


def _transform_mounts(mounts: pd.DataFrame, context: FigureContext) -> pd.DataFrame:
    """Transform mounts from the frames of their links to the robot's frame, and number pairs."""
    frame = mounts[mounts.sensor.notna()].copy()
    frame["link"] = frame.link.astype(str)
    kinds = (*context.beams, *context.signals)
    unknown = (set(frame.link) - set(context.places)) | (set(frame.type) - set(kinds))
    if unknown:
        known = ", ".join((*context.places, *kinds))
        raise InputError(
            f"design.csv: links and types must be listed in setting.json ({known}), not "
            f"{', '.join(map(str, unknown))}; restore the files"
        )
    links = np.array([context.places[link] for link in frame.link]).reshape(-1, 4)
    x, y = frame.x_m.to_numpy(float), frame.y_m.to_numpy(float)
    cos, sin = np.cos(links[:, 3]), np.sin(links[:, 3])
    frame["x_m"], frame["y_m"] = links[:, 0] + cos * x - sin * y, links[:, 1] + sin * x + cos * y
    frame["z_m"] = links[:, 2] + frame.z_m.to_numpy(float)
    yaw = frame.yaw_deg.to_numpy(float) + np.degrees(links[:, 3])
    frame["yaw_deg"] = yaw - 360.0 * np.ceil((yaw - 180.0) / 360.0)
    frame["sensor"] = frame.sensor.astype(int)
    frame["pair"] = _number_pairs(frame, context) if context.mirrored else frame.sensor
    return frame


def _number_pairs(frame: pd.DataFrame, context: FigureContext) -> "pd.Series[int]":
    """Number the pairs of each design; fixed sensors, which have no twins, follow."""
    fixed = frame.type.isin([mount.sensor for mount in context.fixed])
    among = frame.groupby([frame.design, fixed]).cumcount()
    pairs = frame.design.map((~fixed).groupby(frame.design).sum() // 2)
    return (among // 2).where(~fixed, pairs + among).astype(int)


def adapt_types(context: FigureContext, evolved: Mapping[str, float]) -> FigureContext:
    """Return a context with evolved sensor types; ``evolved`` maps keys to values."""

    def find_changes(kind: str, *names: str) -> dict[str, Any]:
        keys = {name: f"{TYPES}{kind}.{name}" for name in names}
        return {name: float(evolved[key]) for name, key in keys.items() if key in evolved}

    beams = {
        kind: _adapt_beam(beam, find_changes(kind, "fov_deg", "range_min_m", "range_max_m"))
        for kind, beam in context.beams.items()
    }
    signals = {
        kind: replace(signal, **find_changes(kind, "width_m", "depth_m"))
        for kind, signal in context.signals.items()
    }
    return replace(context, beams=beams, signals=signals)


def _adapt_beam(beam: Beam, changes: dict[str, Any]) -> Beam:
    if not beam.fov_deg:  # a single ray ignores the field of view
        changes.pop("fov_deg", None)
    wider = changes.get("fov_deg", beam.fov_deg) / beam.fov_deg if beam.fov_deg else 1.0
    bearings = tuple(wider * bearing for bearing in beam.bearings_deg)
    return replace(beam, bearings_deg=bearings, **changes)


def to_number(value: object) -> float:
    """Convert a value to a float; anything but a number becomes NaN."""
    return float(value) if isinstance(value, int | float) else math.nan
