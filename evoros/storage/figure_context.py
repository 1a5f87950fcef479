"""Describes an experiment in ``setting.json``, so that figures need no code or input of a run."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, get_args, get_origin, get_type_hints

import numpy as np

from evoros.base.errors import EvorosError, InputError, single_line
from evoros.base.rng import generator
from evoros.controller.briefing_text import describe_drive
from evoros.design.protocol import Area, Point
from evoros.failure.protocol import Failure, SystematicFailure
from evoros.files.nested import parse_json
from evoros.filter.protocol import Channels, Filter
from evoros.fitness.naming import FitnessName, name_fitness
from evoros.geometry.footprint import project_shape, top_height
from evoros.measure.fitness import FitnessMeasure
from evoros.measure.protocol import DESCRIPTORS, OBJECTIVES
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount, RangeSensor, Sensor, find_field, sees, sensor_bearings
from evoros.storage.layout import SETTING, read_bytes
from evoros.world.course import Course

if TYPE_CHECKING:
    from evoros.evolution.experiment import Experiment
    from evoros.mission.member import Member

_DRAWS = 20  # number of sampled draws whose filters are listed


@dataclass(frozen=True)
class FailureContext:
    """The causes of failures in missions, and the effects of failures on readings."""

    drawn: bool = True  # whether failures are random, so that mission fractions are probabilities
    always_intact: bool = False  # whether no sensor ever fails
    intact: tuple[int, ...] = ()  # trials of a systematic failure without failed sensors
    effects: Mapping[str, str] = field(default_factory=dict)
    """Change of readings (``ends``, ``alters`` or ``grows``) for each named effect."""


class _Drawn(Exception):
    """A failure model requested random numbers."""


class _NoGenerator:
    def __getattr__(self, name: str) -> Any:
        raise _Drawn


def describe_failure(experiment: "Experiment", member: "Member") -> FailureContext:
    """Describe the failure model of an experiment, for the design at the centre of the space."""
    middle = member.space.decode(np.full(member.space.size, 0.5))
    robot = member.with_design(middle).robot
    channels = robot.describe_sensors()
    failure = experiment.failure
    filters = sorted(_list_filters(failure, channels), key=lambda item: item.name)
    effects = {item.name.lower(): item.effect for item in filters}
    if isinstance(failure, SystematicFailure):
        return FailureContext(drawn=False, effects=effects)
    try:
        faults = failure.draw(channels, _NoGenerator())  # type: ignore[arg-type]
    except _Drawn:
        return FailureContext(effects=effects)
    intact = not any(np.isfinite(fault.onset).any() for fault in faults)
    return FailureContext(drawn=False, always_intact=intact, effects=effects)


def _list_filters(failure: Failure, channels: Channels) -> Iterator[Filter]:
    stated = getattr(failure, "effect", None)
    if isinstance(stated, Filter):
        yield stated
    parts = getattr(failure, "failures", {})
    if isinstance(parts, Mapping):
        for part in parts.values():
            yield from _list_filters(part, channels)
    for index in range(_DRAWS):
        faults = failure.draw(channels, generator("effects of faults", f"failure {index}"))
        yield from (fault.filter for fault in faults)


@dataclass(frozen=True)
class Part:
    """The area that one of the robot's shapes covers in top view."""

    link: str
    vertices: tuple[Point, ...]  # [m], convex polygon in the robot frame: x forward, y left
    radius_m: float  # distance [m] up to which points around the polygon belong to the part
    top_m: float  # height [m] above the ground
    wheel: bool


@dataclass(frozen=True)
class Beam:
    """The field of view, range and period of a sensor type."""

    fov_deg: float  # full horizontal angle; 0 for a single ray
    range_min_m: float
    range_max_m: float
    period_s: float  # sampling period
    bearings_deg: tuple[float, ...] = ()  # one per range, left positive; empty for one range
    radiation: str = "ultrasound"  # radiation type in ROS messages
    price: float = 0.0


@dataclass(frozen=True)
class Signal:
    """The readings of a sensor type without rays."""

    measures: str  # motion, wheels or contact
    channels: tuple[tuple[str, str], ...]  # (name, unit) of each value
    period_s: float  # sampling period
    width_m: float = 0.0  # width of a bumper's contact zone; 0 for other sensors
    depth_m: float = 0.0  # distance from the mount to the back of the zone
    price: float = 0.0


@dataclass(frozen=True)
class Ring:
    """The failure probability of sensors within a radius of the centre of damage."""

    radius_m: float
    probability: float


@dataclass(frozen=True)
class FigureContext:
    """The description of an experiment for figures."""

    robot: str
    parts: tuple[Part, ...]
    places: Mapping[str, tuple[float, float, float, float]]  # links' x, y, z [m] and yaw [rad]
    beams: Mapping[str, Beam]  # keyed by sensor type
    regions: Mapping[str, Area]
    mirrored: bool
    rings: tuple[Ring, ...]  # rings of spatial damage, smallest first; empty if there are none
    modes: tuple[str, ...]  # names of modes, counted from 1 in the column ``mode`` of trajectories
    courses: Mapping[str, Course]  # keyed by world
    drive: Mapping[str, float] = field(default_factory=dict)  # the drive as sent to programs
    signals: Mapping[str, Signal] = field(default_factory=dict)  # keyed by type, without rays
    types: tuple[str, ...] = ()  # sensor types in mounting order
    fixed: tuple[Mount, ...] = ()  # sensors common to all designs
    failure: FailureContext = field(default_factory=FailureContext)
    fitness: FitnessName = field(default_factory=FitnessName)
    measures: Mapping[str, FitnessName] = field(default_factory=dict)
    """Names of objectives and descriptors, by column in the tables of generations."""
    genes: Mapping[str, str] = field(default_factory=dict)
    """Key of the evolved value of each gene, except genes of sensors."""
    agents: Mapping[str, "FigureContext"] = field(default_factory=dict)  # other robots by name

    @property
    def text(self) -> str:
        """The content of ``setting.json``."""
        return json.dumps(asdict(self), indent=1) + "\n"

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read ``setting.json`` in a folder."""
        path = folder / SETTING
        try:
            context: Self = _convert(cls, parse_json(read_bytes(path)))
            return context
        except (EvorosError, ValueError, TypeError, KeyError, AttributeError) as error:
            reason = single_line(error)
            raise InputError(f"{path}: damaged or edited ({reason}); restore the file") from error


_get_types = cache(get_type_hints)


def _convert(kind: Any, raw: Any) -> Any:
    """Convert a JSON value; raise KeyError, TypeError or ValueError if it does not fit."""
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


def describe_experiment(experiment: "Experiment") -> FigureContext:
    """Describe an experiment for figures."""
    # The champion's missions are run by the robots for confirmation.
    members = zip(experiment.members, experiment.confirming.members, strict=True)
    first, *others = (_describe(experiment, one, other.controller.modes) for one, other in members)
    agents = dict(zip(experiment.agents, others, strict=True))
    fitness = replace(experiment.scoring.name, bounds=experiment.fitness_bounds)
    measures = dict(_name_measures(experiment))
    return replace(first, fitness=fitness, measures=measures, agents=agents)


def _name_measures(experiment: "Experiment") -> Iterator[tuple[str, FitnessName]]:
    groups = {OBJECTIVES: experiment.objectives, DESCRIPTORS: experiment.descriptors}
    for group, measures in groups.items():
        for key, measure in measures.items():
            same = isinstance(measure, FitnessMeasure)
            name = FitnessName(measure.title, measure.unit)
            yield f"{group}.{key}", experiment.scoring.name if same else name


def _describe(experiment: "Experiment", member: "Member", modes: Sequence[str]) -> FigureContext:
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
    low, high = find_field(sensor)
    opening = math.degrees(high - low)
    limits = float(sensor.range_min_m), float(sensor.range_max_m)
    bearings = [round(math.degrees(bearing), 9) for bearing in sensor_bearings(sensor)]
    several = tuple(bearings) if len(bearings) > 1 else ()
    radiation = sensor.radiation or Beam.radiation
    return Beam(
        round(opening, 9), *limits, float(sensor.period_s), several, radiation, sensor.price
    )


def _signal(sensor: Sensor) -> Signal:
    channels = tuple((channel.name, channel.unit) for channel in sensor.channels)
    width, depth = (float(getattr(sensor, name, 0.0)) for name in ("width_m", "depth_m"))
    return Signal(sensor.measures, channels, float(sensor.period_s), width, depth, sensor.price)


def _rings(failure: Failure) -> Iterator[Ring]:
    radii, probabilities = (getattr(failure, name, ()) for name in ("radii_m", "probabilities"))
    yield from (Ring(float(r), float(p)) for r, p in zip(radii, probabilities, strict=True))
    for part in getattr(failure, "failures", {}).values():
        yield from _rings(part)
