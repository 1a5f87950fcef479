"""The sensors of a robot in a recording: their rays, and their readings over time."""

import math

import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from evoros.base.arrays import Array
from evoros.storage.figure_context import Beam

from ..tables.readings import RecordedSensor
from ..video.camera import Pixels
from ..video.sensors import SILENT_M, FieldOfView, ShownSensor
from .entities import Entities, find_changes

MOST_RAYS = 32
"""A scan is shown by at most about this number of its rays."""
LINE = -1.0
"""The radius of lines: negative ones are points of the screen."""
_ARC = 7  # points on the arc of a fan


def show_sensor(
    top: Entities, sensor: RecordedSensor, shown: ShownSensor, times: Array, colours: Pixels
) -> None:
    """Show what a sensor reads whenever it changes; ``colours`` (n, 3) at each time [s]."""
    _plot(top.below("readings", sensor.link), sensor, times)
    if shown.view is None or not isinstance(sensor.kind, Beam):
        return
    rays, view = top.below("robot", "rays", sensor.link), shown.view
    rays.show(rr.Transform3D(translation=view.frame[:3, 3], mat3x3=view.frame[:3, :3]))
    changes = find_changes(sensor.readings, colours)
    ranges = np.where(np.isnan(sensor.readings), min(SILENT_M, view.range_m), sensor.readings)
    bearings = np.radians(sensor.kind.bearings_deg)
    strips = [strip for i in changes for strip in draw_rays(ranges[i], bearings, view)]
    each = len(strips) // len(changes)
    columns = rr.LineStrips3D.columns(
        strips=strips,
        colors=np.repeat(colours[changes], each, axis=0),
        radii=np.full(len(strips), LINE),
    )
    rays.show_over_time(times[changes], columns.partition([each] * len(changes)))


def draw_rays(ranges: Array, bearings: Array, view: FieldOfView) -> list[Array]:
    """Return lines (k, 3) [m] in the frame of a sensor: the outline of its fan, or its rays."""
    if len(ranges) == 1:
        return [draw_fan(float(ranges[0]), view.half_rad)]
    step = math.ceil(len(ranges) / MOST_RAYS)
    ends = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings), 0.0 * ranges], axis=1)
    return [np.array([np.zeros(3), end]) for end in ends[::step]]


def draw_fan(reach: float, half_rad: float) -> Array:
    """Return the outline (k, 3) [m] of a fan about x."""
    angles = np.linspace(-half_rad, half_rad, _ARC)
    arc = reach * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    return np.vstack([np.zeros(3), arc, np.zeros(3)])


def place_fan(place: Array, yaw_rad: float, pitch_rad: float, fan: Array) -> Array:
    """Return the points (k, 3) of a fan in the frame of the robot."""
    turned: Array = Rotation.from_euler("ZY", [yaw_rad, pitch_rad]).apply(fan) + place
    return turned


def _plot(top: Entities, sensor: RecordedSensor, times: Array) -> None:
    """Plot the readings of a sensor, of a scan the nearest."""
    kind = sensor.kind
    if isinstance(kind, Beam):
        values, names = np.fmin.reduce(sensor.readings, axis=1)[:, None], [f"{sensor.link} [m]"]
    else:
        values = sensor.readings
        names = [
            f"{sensor.link} {name} [{unit}]".replace(" []", "") for name, unit in kind.channels
        ]
    top.show(rr.SeriesLines(names=names))
    changes = find_changes(values)
    columns = rr.Scalars.columns(scalars=values[changes].ravel())
    top.show_over_time(times[changes], columns.partition([values.shape[1]] * len(changes)))
