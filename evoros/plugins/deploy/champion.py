"""The champion of a run as mounted on the robot: its description, sensors and overlaps."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from lxml.etree import _Element as Element

from evoros.analysis.tables import champions
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.tracks import select_robot
from evoros.formats.strict_xml import find_child, parse
from evoros.formats.urdf.parts import read_origin, read_value
from evoros.formats.urdf.tree import Urdf, read_frames, read_tree
from evoros.geometry.shapes import Pose, Shape
from evoros.robot.housings import Housing, find_overlaps
from evoros.sensor.protocol import find_prefix
from evoros.storage.figure_context import Beam, Signal
from evoros.storage.layout import ROBOT_AS_LOADED, SELF_SIGHT
from evoros.storage.reading import read_table
from evoros.storage.verification import read_text

ROBOT = "robot.urdf"
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class MountedSensor:
    """A sensor of the champion in the robot's frame: x forward, y left, z up from the ground."""

    link: str  # link in the description; its x axis points along the beam
    type: str
    position_m: Triple
    yaw_deg: float  # left positive
    pitch_deg: float  # nose up positive
    kind: Beam | Signal
    size_m: Triple  # dimensions of the sensor body along the axes of the link


@dataclass(frozen=True, eq=False)
class Champion:
    """The best design of a run, as recorded in its folder."""

    record: Record
    robot: Element  # robot description with the sensors
    shown: Urdf  # the description that engines loaded, with the root on the ground
    sensors: tuple[MountedSensor, ...]
    centre_m: Triple | None  # centre of mass in the robot's frame; None if the robot has no masses
    self_sights: pd.DataFrame  # rows of self_sight.csv: sensors that see the robot
    values: Mapping[str, Any]  # configuration by dotted key, with the evolved values

    @property
    def name(self) -> str:
        """The name of the robot."""
        return str(self.robot.get("name"))

    @property
    def title(self) -> str:
        """The design number, the run and the robot, for titles."""
        run = self.record.run
        known = [*run.champion.design.dropna(), *run.genes.design.dropna()]
        design = f"design {int(known[0])}" if known else "the best design, without sensors,"
        robot = f", for {self.record.agent}" if self.record.agent else ""
        return f"{design} of the run {self.record.name}{robot}"

    @property
    def genes(self) -> list[tuple[str, str, Any]]:
        """Name, key and value of each evolved value that does not belong to a mount."""
        rows = select_robot(self.record.run.genes).to_dict("records")
        return [(str(row["gene"]), row["key"], self.values[row["key"]]) for row in rows]


def read_champion(record: Record) -> Champion:
    """Read the champion of a finished run."""
    folder = record.run.champion_file(ROBOT, record.agent).parent
    robot = _parse_file(folder / ROBOT)
    loaded = folder / ROBOT_AS_LOADED
    shown = loaded if loaded.exists() else folder / ROBOT
    urdf = read_tree(_parse_file(shown), str(shown))
    described = read_frames(robot, str(folder / ROBOT))  # reads no meshes, which may be missing
    ground = Pose(record.context.places[described.root][:3])
    return Champion(
        record=record,
        robot=robot,
        shown=urdf,
        sensors=tuple(_read_sensors(record, urdf)),
        centre_m=_centre_of_mass(robot, described, ground),
        self_sights=read_table(folder / SELF_SIGHT, ("distance_m", "hidden_share")),
        values=dict(_effective_values(record)),
    )


def _parse_file(path: Any) -> Element:
    return parse(read_text(path).encode(), str(path))


def _effective_values(record: Record) -> Iterator[tuple[str, Any]]:
    """Yield the configuration values, with the champion's evolved values."""
    genes = select_robot(record.run.genes)
    evolved = dict(zip(genes.key.astype(str), genes.value.tolist(), strict=True))
    for key, value in {**record.values, **evolved}.items():
        counts = isinstance(record.values.get(key), int) and float(value).is_integer()
        yield key, int(value) if key in evolved and counts else value


def _read_sensors(record: Record, urdf: Urdf) -> Iterator[MountedSensor]:
    context = champions.adapt_context(record)
    kinds: Mapping[str, Beam | Signal] = {**context.beams, **context.signals}
    tables = champions.read_champion_sensors(record), champions.read_champion_signals(record)
    rows = [row for table in tables for row in table.to_dict("records")]
    prefix = find_prefix(urdf.poses, context.types)
    for row in sorted(rows, key=lambda row: int(row["sensor"])):
        kind = str(row["type"])
        link = f"{prefix}{kind}_{row['sensor']}"
        if link not in urdf.poses:
            raise urdf.error(f"lacks the link {link} of a sensor", "restore the file")
        yield MountedSensor(
            link=link,
            type=kind,
            position_m=(row["x_m"], row["y_m"], row["z_m"]),
            yaw_deg=row["yaw_deg"],
            pitch_deg=row["pitch_deg"],
            kind=kinds[kind],
            size_m=_body_size(urdf.visuals[link]),
        )


def _body_size(shapes: Sequence[Shape]) -> Triple:
    if not shapes or shapes[0].kind != "box":
        return 0.0, 0.0, 0.0
    x, y, z = shapes[0].size
    return x, y, z


def _centre_of_mass(robot: Element, urdf: Urdf, ground: Pose) -> Triple | None:
    total, moment = 0.0, np.zeros(3)
    for link in robot.findall("link"):
        inertial = find_child(link, "inertial")
        mass = None if inertial is None else find_child(inertial, "mass")
        if inertial is None or mass is None:
            continue
        pose = ground @ urdf.poses[str(link.get("name"))] @ read_origin(inertial)
        kilograms = read_value(mass, "value", "0")
        total, moment = total + kilograms, moment + kilograms * np.array(pose.position)
    if total <= 0.0:
        return None
    x, y, z = ((moment / total).round(6) + 0.0).tolist()
    return x, y, z


def list_clashes(sensors: Sequence[MountedSensor]) -> Iterator[str]:
    """Yield a message for each pair of sensors whose housings overlap."""
    housings = []
    for sensor in sensors:
        pitch, yaw = np.radians(-sensor.pitch_deg), np.radians(sensor.yaw_deg)
        axes = Pose.from_rpy((0.0, 0.0, 0.0), 0.0, pitch, yaw).rotation.T
        housings.append(Housing(sensor.link, sensor.position_m, axes, sensor.size_m))
    for depth, first, second in find_overlaps(housings):
        yield (
            f"the bodies of {first} and {second} overlap; move one of the two by "
            f"{1000 * depth:.1f} mm or more"
        )


def list_hidden(champion: Champion) -> Iterator[str]:
    """Yield a message for each sensor whose view the robot blocks in part."""
    for row in champion.self_sights.to_dict("records"):
        yield (
            f"the robot blocks {100 * row['hidden_share']:.0f} % of the cone of {row['sensor']}, "
            f"which sees {row['seen_link']} {row['distance_m']:.3g} m away at some steering angle; "
            f"move or turn the sensor"
        )
