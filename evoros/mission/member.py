"""One of the robots of a scenario: its parts, its course, its names and the genes it declares."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from typing import Annotated

from evoros.base.checks import checked, instance_of
from evoros.base.errors import InputError
from evoros.controller.protocol import (
    A_CONTROLLER,
    Controller,
    EvolvedValue,
    EvolvingPart,
    LiveController,
)
from evoros.design.design import Design
from evoros.design.genes import Gene, replace_values
from evoros.design.space import DesignSpace, SensorDesign
from evoros.filter.protocol import Filter
from evoros.mission.outcome import ESTIMATE, ROBOT_COLUMNS
from evoros.robot.model import Robot
from evoros.sensor.protocol import name_channels
from evoros.world.course import Course


@dataclass(frozen=True, eq=False)
@checked
class Member:
    """A robot of a scenario, with its parts, course and names.

    The first fields are named like the groups of the configuration, so that the key of an evolved
    value, for example ``controller.avoidance.range_m``, is also its path in a member.
    """

    robot: Annotated[Robot, instance_of(Robot, "a robot")]
    design: Annotated[SensorDesign, instance_of(SensorDesign, "a sensor design")]
    controller: Annotated[Controller | LiveController, A_CONTROLLER]
    name: str = ""  # in tables of designs
    column: str = ""  # before its columns in tables, for example "NAME."
    key: str = ""  # before its keys and the names of its random streams: "agents.NAME."
    designed: str = ""  # the name of the robot whose design it has
    home: tuple[float, float, float] | None = None  # x, y [m], yaw [rad]; None: the course's
    route: Sequence[Sequence[float]] | None = None  # the corners [m]; None: the course's
    scored: bool = True  # whether it counts for the fitness, and missions wait for it
    meets_cases: bool = True  # whether it meets the stated cases of failures
    records_pose: bool = False  # whether trajectories have its pose as localized in any case

    def place(self, course: Course) -> Course:
        """Return the course of a world with this robot's home and route."""
        if self.home is not None:
            x, y, yaw = self.home
            course = replace(course, home_x_m=x, home_y_m=y, home_yaw_rad=yaw)
        return course if self.route is None else replace(course, waypoints=self.route)

    def tell(self, message: object) -> str:
        """Return a message with the key of this robot before it."""
        return f"{self.key[:-1]}: {message}" if self.key else f"{message}"

    @property
    def has_own_design(self) -> bool:
        """Whether it has a design of its own."""
        return self.designed == self.name

    @cached_property
    def space(self) -> DesignSpace:
        """The search space of its design, with the genes that its controller declares."""
        return self.design.bind(self.robot, find_declared_genes(self.controller))

    def find_design(self, design: Design) -> Design:
        """Return the part of a design for this robot.

        Raises:
            InputError: the design lacks a part for a robot that is designed alone, or has one for
                a robot that is not.
        """
        parts = design.parts
        if not self.has_own_design and self.name in parts:
            raise InputError(
                f"{self.key}design: must not be null, because the design has one for this "
                f"robot alone; choose one with +design@{self.key}design=..., as in the run"
            )
        if self.designed not in parts:
            raise InputError(
                f"{self.key}design: must be null for a design that has none for this robot; "
                f"give it one, or remove that key"
            )
        return parts[self.designed]

    def with_design(self, design: Design) -> "Member":
        """Return this robot with the sensors of its design and its evolved values.

        Raises:
            InputError: a value that the part refuses, a sensor that cannot be mounted.
        """
        member = replace_values(self, design.values)
        robot = member.robot.with_sensors(design.mounts, member.design.sensors)
        return replace(member, robot=robot)

    def name_columns(self, design: Design) -> list[str]:
        """Return the robot's columns in a trajectory, also of a design that a part refuses."""
        try:
            sensors = self.with_design(design).design.sensors
        except InputError:
            sensors = self.design.sensors
        readings = name_channels(sensors[mount.sensor] for mount in design.mounts)
        columns = (*ROBOT_COLUMNS, *readings, *self.pose_columns)
        return [f"{self.column}{name}" for name in columns]

    @property
    def pose_columns(self) -> tuple[str, ...]:
        """The columns of a trajectory for an estimated pose; none if filters change the true."""
        parts = self.controller.localization.values()
        estimates = any(not isinstance(part, Filter) for part in parts)
        return ESTIMATE if estimates or self.records_pose else ()


def find_declared_genes(controller: object) -> dict[str, Gene]:
    """Return the genes of a controller and of its parts, such as layers, by name.

    Raises:
        InputError: two have the same name, or a range is none.
    """
    genes: dict[str, Gene] = {}
    for at, name, value in _list_declared(controller, "controller"):
        if name in genes:
            raise InputError(
                f"{at}: must not declare the gene {name}, which another part of the controller "
                f"declares too; rename it in its class"
            )
        low, high = float(value.low), float(value.high)
        genes[name] = Gene(f"{at}.{value.path}", low, high, group=value.group or None)
    return genes


def _list_declared(part: object, at: str) -> Iterator[tuple[str, str, EvolvedValue]]:
    """Yield the key of the part that declares a gene, the gene's name, and its value."""
    if isinstance(part, EvolvingPart):
        for name, value in part.evolved.items():
            yield at, name, value
    if is_dataclass(part):
        for field in fields(part):
            yield from _list_declared(getattr(part, field.name), f"{at}.{field.name}")
    elif isinstance(part, Mapping):
        for key, child in part.items():
            yield from _list_declared(child, f"{at}.{key}")
