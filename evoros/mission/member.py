"""A robot of a scenario, with its parts, course, names and declared genes."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from typing import Annotated, Any

from evoros.base.checks import checked, instance_of
from evoros.base.errors import InputError
from evoros.controller import protocol
from evoros.design.design import Design
from evoros.design.genes import Gene, replace_values
from evoros.design.space import DesignSpace, SensorDesign
from evoros.filter.protocol import Filter
from evoros.mission.mission import ESTIMATE, ROBOT_COLUMNS
from evoros.robot.model import Robot
from evoros.sensor.protocol import check_sensor, name_channels
from evoros.world.course import Course


@dataclass(frozen=True, eq=False)
@checked
class Member:
    """A robot of a scenario; fields are named after configuration groups, as in keys of genes."""

    robot: Annotated[Robot, instance_of(Robot, "a robot")]
    design: Annotated[SensorDesign, instance_of(SensorDesign, "a sensor design")]
    controller: Annotated[protocol.Controller | protocol.LiveController, protocol.A_CONTROLLER]
    name: str = ""  # name in design tables
    column: str = ""  # prefix of the robot's table columns, for example "NAME."
    key: str = ""  # prefix of configuration keys and random streams, for example "agents.NAME."
    designed: str = ""  # name of the robot whose design this robot shares
    home: tuple[float, float, float] | None = None  # x, y [m], yaw [rad]; None: home of the course
    route: Sequence[Sequence[float]] | None = None  # waypoints [m]; None: route of the course
    scored: bool = True  # whether the fitness counts the robot and missions wait for it
    meets_cases: bool = True  # whether stated failure cases apply to the robot
    records_pose: bool = False  # whether the estimated pose is always recorded

    def place(self, course: Course) -> Course:
        """Return ``course`` with this robot's home and route."""
        if self.home is not None:
            x, y, yaw = self.home
            course = replace(course, home_x_m=x, home_y_m=y, home_yaw_rad=yaw)
        return course if self.route is None else replace(course, waypoints=self.route)

    def tell(self, message: object) -> str:
        """Prefix a message with the key of this robot."""
        return f"{self.key[:-1]}: {message}" if self.key else f"{message}"

    def check_parts(self) -> None:
        """Check that the sensors and the controller follow their protocols."""
        for name, sensor in self.design.sensors.items():
            self._check(f"design.sensors.{name}", check_sensor, sensor)
        self._check("controller", protocol.check_controller, self.controller)

    def _check(self, key: str, check: Callable[[Any], None], part: object) -> None:
        try:
            check(part)
        except InputError as error:
            raise type(error)(f"{self.key}{key}: {error}") from None

    @property
    def has_own_design(self) -> bool:
        """True if the robot has a separate design."""
        return self.designed == self.name

    @cached_property
    def space(self) -> DesignSpace:
        """The search space of the robot's design, including genes of the controller."""
        return self.design.bind(self.robot, find_declared_genes(self.controller))

    def find_design(self, design: Design) -> Design:
        """Return the part of ``design`` for this robot."""
        parts = design.parts
        if not self.has_own_design and self.name in parts:
            raise InputError(
                f"{self.key}design: must not be null, because the design has a part for this "
                f"robot; choose a design with +design@{self.key}design=..., as in the run"
            )
        if self.designed not in parts:
            raise InputError(
                f"{self.key}design: must be null for a design without a part for this robot; "
                f"add that part to the design, or remove this key"
            )
        return parts[self.designed]

    def with_design(self, design: Design) -> "Member":
        """Return this robot with the sensors of its design and its evolved values."""
        member = replace_values(self, design.values)
        robot = member.robot.with_sensors(design.mounts, member.design.sensors)
        return replace(member, robot=robot)

    def name_columns(self, design: Design) -> list[str]:
        """Return the robot's trajectory columns, even for a design that a part rejects."""
        try:
            sensors = self.with_design(design).design.sensors
        except InputError:
            sensors = self.design.sensors
        readings = name_channels(sensors[mount.sensor] for mount in design.mounts)
        columns = (*ROBOT_COLUMNS, *readings, *self.pose_columns)
        return [f"{self.column}{name}" for name in columns]

    @property
    def pose_columns(self) -> tuple[str, ...]:
        """The trajectory columns of the estimated pose; empty if it is not recorded."""
        parts = self.controller.localization.values()
        estimates = any(not isinstance(part, Filter) for part in parts)
        return ESTIMATE if estimates or self.records_pose else ()


def find_declared_genes(controller: object) -> dict[str, Gene]:
    """Return the genes that a controller and its parts, such as layers, declare, by name."""
    genes: dict[str, Gene] = {}
    for at, name, value in _list_declared(controller, "controller"):
        if name in genes:
            raise InputError(
                f"{at}: must not declare the gene {name}, which another part of the controller "
                "also declares; rename the gene in one of the classes"
            )
        low, high = float(value.low), float(value.high)
        genes[name] = Gene(f"{at}.{value.path}", low, high, group=value.group or None)
    return genes


def _list_declared(part: object, at: str) -> Iterator[tuple[str, str, protocol.EvolvedValue]]:
    if isinstance(part, protocol.ControllerPart):
        for name, value in part.evolved.items():
            yield at, name, value
    if is_dataclass(part):
        for field in fields(part):
            yield from _list_declared(getattr(part, field.name), f"{at}.{field.name}")
    elif isinstance(part, Mapping):
        for key, child in part.items():
            yield from _list_declared(child, f"{at}.{key}")
