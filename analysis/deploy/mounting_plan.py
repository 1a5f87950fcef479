"""The content of the drawing of a champion's mounts, in millimetres from its datum."""

from collections.abc import Iterator

import numpy as np

from evoros.base.arrays import Array
from evoros.drive.rolling import shape_points
from evoros.geometry.shapes import Pose, Shape
from evoros.storage.figure_context import Beam, Signal

from ..drawing.mounting_plan import MountingPlan, PlacedSensor, Solid
from .champion import Champion, MountedSensor

_MM = 1000.0
_SAME_MM = 0.5  # wheels whose centres differ by less share an axis


def plan_mounting(champion: Champion) -> MountingPlan:
    """Collect what a drawing of the champion's mounts shows."""
    sensors = tuple(map(_place, champion.sensors))
    links = {sensor.link for sensor in champion.sensors}
    wheels = {part.link for part in champion.record.context.parts if part.wheel}
    centres = np.array([champion.shown.poses[link].position for link in sorted(wheels)]) * _MM
    return MountingPlan(
        title=f"{champion.name}: where to mount its {len(sensors)} sensors",
        source=champion.title,
        datum=_describe_datum(centres),
        solids=tuple(_list_solids(champion, links, wheels)),
        sensors=sensors,
        centre_mm=None if champion.centre_m is None else np.array(champion.centre_m) * _MM,
        axles_mm=tuple(_merge(centres[:, 0].tolist())) if len(centres) else (),
    )


def _place(sensor: MountedSensor) -> PlacedSensor:
    x, y, z = (_MM * value for value in sensor.position_m)
    pose = Pose.from_rpy((x, y, z), 0.0, -np.radians(sensor.pitch_deg), np.radians(sensor.yaw_deg))
    size = tuple(_MM * value for value in sensor.size_m)
    corners = shape_points(Shape("box", size), pose) if min(size) > 0.0 else np.empty((0, 3))
    return PlacedSensor(
        name=sensor.link,
        place_mm=np.array([x, y, z]),
        yaw_deg=sensor.yaw_deg,
        pitch_deg=sensor.pitch_deg,
        fov_deg=sensor.kind.fov_deg if isinstance(sensor.kind, Beam) else None,
        reach=_describe_reach(sensor.kind),
        corners_mm=corners,
    )


def _describe_reach(kind: Beam | Signal) -> str:
    if isinstance(kind, Beam):
        return f"{kind.range_min_m:g} to {kind.range_max_m:g} m"
    return f"zone {kind.width_m:g} m wide" if kind.width_m > 0.0 else "none"


def _list_solids(champion: Champion, sensors: set[str], wheels: set[str]) -> Iterator[Solid]:
    """Yield what the robot shows, without its sensors."""
    for link, shapes in champion.shown.visuals.items():
        for shape in shapes if link not in sensors else ():
            points = shape_points(shape, champion.shown.poses[link] @ shape.pose)
            yield Solid(_MM * points, link in wheels)


def _describe_datum(wheels: Array) -> str:
    """Describe the origin of the robot's frame by the centres (n, 3) [mm] of its wheels."""
    if not len(wheels):
        return "the origin of the robot's frame, which lies on the ground"
    sides = wheels[:, 1]
    middle = abs(sides.min() + sides.max()) < _SAME_MM
    across = "midway between the wheels" if middle else "at y = 0 of the robot's frame"
    ahead = -float(wheels[:, 0].min())
    if abs(ahead) < _SAME_MM:
        along = "below the axis of the rearmost wheels"
    else:
        way = "ahead of" if ahead > 0.0 else "behind"
        along = f"{round(abs(ahead), 1):g} mm {way} the axis of the rearmost wheels"
    return f"on the ground, {across}, {along}"


def _merge(values: list[float]) -> Iterator[float]:
    """Yield increasing values, of those that are nearly equal the first."""
    last = -np.inf
    for value in sorted(values):
        if value - last > _SAME_MM:
            yield value
            last = value
