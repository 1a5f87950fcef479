"""Describes an experiment for figures, in plain numbers, as ``setting.json``.

The file lies in the folder of a run, so that figures need neither the code nor the files from which
the run was made.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, get_args, get_origin, get_type_hints

import numpy as np

from evoros.base.errors import EvorosError, InputError, single_line
from evoros.controller.briefing_text import describe_drive
from evoros.design.protocol import Area, Point
from evoros.failure.protocol import Failure
from evoros.files.nested import parse_json
from evoros.fitness.naming import FitnessName, bound_fitness, name_fitness
from evoros.geometry.footprint import project_shape, top_height
from evoros.measure.fitness import FitnessMeasure
from evoros.measure.protocol import DESCRIPTORS, OBJECTIVES
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount, RangeSensor, Sensor, sees, sensor_bearings
from evoros.storage.failure_context import FailureContext, describe_failure
from evoros.storage.file_reading import read_bytes
from evoros.storage.layout import SETTING
from evoros.world.course import Course

if TYPE_CHECKING:
    from evoros.evolution.experiment import Experiment
    from evoros.mission.member import Member


@dataclass(frozen=True)
class Part:
    """The area that one shape of the robot covers, seen from above."""

    link: str
    vertices: tuple[Point, ...]  # [m] convex, in the robot's frame: x forward, y left
    radius_m: float  # points within this distance of the polygon belong to the part
    top_m: float  # above the ground
    wheel: bool


@dataclass(frozen=True)
class Beam:
    """The field of view, range and period of a type of sensor."""

    fov_deg: float  # between its outermost rays, horizontally
    range_min_m: float
    range_max_m: float
    period_s: float  # between two readings
    bearings_deg: tuple[float, ...] = ()
    """The bearing of each range in the sensor's frame, left positive; empty for one range."""
    radiation: str = "ultrasound"  # as nodes of ROS are told


@dataclass(frozen=True)
class Signal:
    """The readings of a type of sensor that casts no rays."""

    measures: str  # motion, wheels or contact
    channels: tuple[tuple[str, str], ...]  # name and unit of each value
    period_s: float  # between two readings
    width_m: float = 0.0  # of the zone in which a bumper feels; 0: it is no bumper
    depth_m: float = 0.0  # how far behind its mount the zone begins


@dataclass(frozen=True)
class Ring:
    """The probability that a sensor within a radius of the centre of damage fails."""

    radius_m: float
    probability: float


@dataclass(frozen=True)
class FigureContext:
    """An experiment as figures show it."""

    robot: str
    parts: tuple[Part, ...]
    places: Mapping[str, tuple[float, float, float, float]]
    """Links that can carry sensors: x, y, z [m], yaw [rad] in the robot's frame."""
    beams: Mapping[str, Beam]  # by the type of the sensor
    regions: Mapping[str, Area]
    mirrored: bool
    rings: tuple[Ring, ...]  # of spatial damage, from the smallest; empty: no damage
    modes: tuple[str, ...]  # by the number in a trajectory's column ``mode``, from 1
    courses: Mapping[str, Course]  # by the world's name
    drive: Mapping[str, float] = field(default_factory=dict)  # as programs are told of it
    signals: Mapping[str, Signal] = field(default_factory=dict)  # of types that cast no rays
    types: tuple[str, ...] = ()  # of sensors, in the order in which they are mounted
    fixed: tuple[Mount, ...] = ()  # sensors that every design has
    failure: FailureContext = field(default_factory=FailureContext)
    fitness: FitnessName = field(default_factory=FitnessName)
    measures: Mapping[str, FitnessName] = field(default_factory=dict)
    """Names of objectives and descriptors by the columns of the tables of generations."""
    genes: Mapping[str, str] = field(default_factory=dict)
    """Keys of the values that evolve besides the sensors, by the names of their genes."""
    agents: Mapping[str, "FigureContext"] = field(default_factory=dict)
    """The other robots by name, each as if it were alone."""

    @property
    def text(self) -> str:
        """The content of ``setting.json``."""
        return json.dumps(asdict(self), indent=1) + "\n"

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the file in a folder."""
        path = folder / SETTING
        try:
            context: Self = _convert(cls, parse_json(read_bytes(path)))
            return context
        except (EvorosError, ValueError, TypeError, KeyError, AttributeError) as error:
            reason = single_line(error)
            raise InputError(
                f"{path}: must be as evoros wrote it ({reason}); restore it"
            ) from error


def _convert(kind: Any, raw: Any) -> Any:
    """Convert a value of a JSON file to a type: a dataclass, a tuple, a mapping or a scalar.

    Raises:
        KeyError, TypeError, ValueError: it does not fit.
    """
    inner = get_args(kind)
    if isinstance(kind, type) and is_dataclass(kind):
        types = _get_types(kind)
        return kind(**{name: _convert(types[name], value) for name, value in raw.items()})
    if get_origin(kind) is tuple and inner[-1] is not Ellipsis:
        if len(raw) != len(inner):
            raise ValueError(f"{raw} must be {len(inner)} numbers")
        return tuple(map(_convert, inner, raw))
    if get_origin(kind) is tuple:
        return tuple(_convert(inner[0], item) for item in raw)
    if get_origin(kind) is Mapping:
        return {name: _convert(inner[1], value) for name, value in raw.items()}
    return kind(raw) if kind in (float, int, str) else raw


@cache
def _get_types(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)


def describe_experiment(experiment: "Experiment") -> FigureContext:
    """Describe an experiment for figures."""
    # The champion's missions are run by the confirming robots.
    members = zip(experiment.members, experiment.confirming.members, strict=True)
    contexts = [
        _describe(experiment, member, confirming.controller.modes) for member, confirming in members
    ]
    agents = dict(zip(experiment.agents, contexts[1:], strict=True))
    bounds = bound_fitness(experiment.fitness, len(experiment.world))
    fitness = replace(experiment.scoring.name, bounds=bounds)
    measures = dict(_name_measures(experiment))
    return replace(contexts[0], fitness=fitness, measures=measures, agents=agents)


def _name_measures(experiment: "Experiment") -> Iterator[tuple[str, FitnessName]]:
    """Yield the column and the name of each objective and descriptor."""
    groups = {OBJECTIVES: experiment.objectives, DESCRIPTORS: experiment.descriptors}
    for group, measures in groups.items():
        for key, measure in measures.items():
            same = isinstance(measure, FitnessMeasure)
            name = FitnessName(measure.title, measure.unit)
            yield f"{group}.{key}", experiment.scoring.name if same else name


def _describe(experiment: "Experiment", member: "Member", modes: Sequence[str]) -> FigureContext:
    """Describe a robot as if it were alone."""
    robot, space, sensors = member.robot, member.space, member.design.sensors
    genes = experiment.space.spaces[member.designed].genes
    return FigureContext(
        robot=robot.name,
        parts=tuple(_parts(robot)),
        places=dict(robot.sensor_links),
        beams={name: _beam(sensor) for name, sensor in sensors.items() if sees(sensor)},
        regions={name: region.area() for name, region in space.regions.items()},
        mirrored=member.design.mirrored,
        rings=tuple(_rings(experiment.failure)),
        modes=tuple(modes),
        courses={name: member.place(world.course) for name, world in experiment.world.items()},
        drive=describe_drive(robot.drive),
        signals={name: _signal(s) for name, s in sensors.items() if not sees(s)},
        types=tuple(sensors),
        fixed=tuple(space.fixed),
        failure=describe_failure(experiment, member),
        fitness=name_fitness(experiment.fitness),
        genes={name: gene.key for name, gene in genes.items()},
    )


def _parts(robot: Robot) -> Iterator[Part]:
    for visible in robot.visuals:
        area = project_shape(visible.shape, visible.pose)
        top = top_height(visible.shape, visible.pose)
        corners = tuple((float(x), float(y)) for x, y in area.vertices.tolist())
        yield Part(visible.link, corners, float(area.radius), float(top), visible.rolls)


def _beam(sensor: RangeSensor) -> Beam:
    rays = np.asarray(sensor.rays())
    opening = math.degrees(float(np.ptp(np.arctan2(rays[:, 1], rays[:, 0]))))
    limits = float(sensor.range_min_m), float(sensor.range_max_m)
    bearings = [round(math.degrees(bearing), 9) for bearing in sensor_bearings(sensor)]
    several = tuple(bearings) if len(bearings) > 1 else ()
    radiation = str(getattr(sensor, "radiation", Beam.radiation))
    return Beam(round(opening, 9), *limits, float(sensor.period_s), several, radiation)


def _signal(sensor: Sensor) -> Signal:
    channels = tuple((channel.name, channel.unit) for channel in sensor.channels)
    zone = [float(getattr(sensor, name, 0.0)) for name in ("width_m", "depth_m")]
    return Signal(sensor.measures, channels, float(sensor.period_s), *zone)


def _rings(failure: Failure) -> Iterator[Ring]:
    """Yield the rings of a failure that has radii with probabilities, or combines such ones."""
    radii, probabilities = (getattr(failure, name, ()) for name in ("radii_m", "probabilities"))
    yield from (Ring(float(r), float(p)) for r, p in zip(radii, probabilities, strict=True))
    for part in getattr(failure, "failures", {}).values():
        yield from _rings(part)
