"""The parts that all missions of an experiment share, checked for compatibility."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Annotated

from evoros.base.checks import checked, instance_of
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.controller.protocol import LiveController
from evoros.design.design import Design
from evoros.failure.protocol import Failure
from evoros.mission.member import Member
from evoros.mission.mission import TIME, TRAJECTORY, WALKER
from evoros.sensor.protocol import Sensor, add_prices
from evoros.simulator.protocol import A_SIMULATOR, PlacedRobot, Simulator
from evoros.walkers.crowd import WALKERS, Walkers
from evoros.walkers.forces import FASTEST
from evoros.walkers.layout import REPORT_COLUMNS
from evoros.world.crowds import Standing, advise, check_walkers, draw_crowd, name_walkers
from evoros.world.model import World


def require_world(name: str, world: object) -> None:
    """Check that an entry of ``world`` in the configuration is a world."""
    if not isinstance(world, World):
        raise InputError(
            f"world.{name}: some keys of the world are missing; choose a world with "
            f"world=[...], or remove world.{name}"
        )


@dataclass(frozen=True, eq=False)  # hashable by identity, for use as a cache key
@checked
class Scenario:
    """Everything that a mission requires except the design, the world's name and the draws."""

    members: tuple[Member, ...]
    world: Annotated[Mapping[str, World], instance_of(Mapping, "a mapping from names to worlds")]
    failure: Annotated[
        Failure, instance_of(Failure, "a failure model (a subclass of evoros.parts.Failure)")
    ]
    simulator: Annotated[Simulator, A_SIMULATOR]
    walkers: Annotated[Mapping[str, Walkers], WALKERS] = field(default_factory=dict)
    _newest: "tuple[Design, tuple[Member, ...]] | None" = field(default=None, init=False)

    def __post_init__(self) -> None:
        if not self.world:
            raise InputError(
                "world: must have at least one world; add world=case_study, for example"
            )
        for name, world in self.world.items():
            require_world(name, world)
            try:
                self.simulator.check_world(world)
            except InputError as error:
                raise InputError(f"world.{name}: {error}") from None
        for member in self.members:
            try:
                self.place_worlds(member)
                self.check_parts(member)
            except InputError as error:
                raise InputError(member.tell(error)) from None
        most = self.simulator.max_robots
        if len(self.members) > most:
            raise InputError(
                f"agents: there must be at most {most - 1}, not {len(self.members) - 1}, because "
                f"{type(self.simulator).__name__} supports worlds with up to {most} robots "
                "(max_robots); remove some, or use another simulator, for example "
                f"simulator=planar or simulator=physics"
            )
        self._check_walkers()

    def _check_walkers(self) -> None:
        for name, world in self.world.items():
            names = name_walkers(self.walkers, world)
            if not names:
                continue
            check_walkers(world, name, self.walkers)
            if len(set(names)) < len(names):
                twice = next(one for one in names if names.count(one) > 1)
                raise InputError(
                    f"walkers: two walkers in world.{name} have the name {twice}; rename the group "
                    "or the actor"
                )
            if not self.simulator.has_walkers:
                raise InputError(
                    f"walkers: must be empty with {type(self.simulator).__name__}, which does not "
                    f"move walkers (has_walkers); {advise(name, self.walkers)}, or use another "
                    "simulator, for example simulator=planar"
                )
        for name, group in self.walkers.items():
            longest = FASTEST * group.paces[1] * self.simulator.time_step
            if longest > group.radius_m:
                raise InputError(
                    f"walkers.{name}.pace_mps: must be at most "
                    f"{group.radius_m / (FASTEST * self.simulator.time_step):.2g} m/s, not "
                    f"{group.paces[1]:g}, so that a walker moves less than radius_m in a time "
                    "step; lower the pace or simulator.time_step"
                )

    def draw_world(self, name: str, draws: str, robots: Sequence[PlacedRobot]) -> World:
        """Return the world, including walkers, of all missions with the key ``draws``."""
        world = self.world[name].at(draws)
        if not self.any_walkers:
            return world
        standing = [Standing(robot.outline, (x, y, yaw)) for robot, (x, y, _, yaw) in robots]
        return world.with_crowd(
            draw_crowd(world, self.walkers, standing, partial(generator, draws))
        )

    def list_walkers(self, world: str) -> list[str]:
        """Return the names of all walkers in a world."""
        return name_walkers(self.walkers, self.world[world])

    @cached_property
    def any_walkers(self) -> bool:
        """True if any world has walkers."""
        return any(self.list_walkers(name) for name in self.world)

    @property
    def states_shortest(self) -> bool:
        """True if the length of the shortest path is known in any world."""
        return any(world.shortest_m is not None for world in self.world.values())

    def place_worlds(self, member: Member) -> dict[str, World]:
        """Return the worlds by name, with courses adapted to this robot."""
        courses = {name: member.place(world.course) for name, world in self.world.items()}
        return {
            name: world if world.course is courses[name] else replace(world, course=courses[name])
            for name, world in self.world.items()
        }

    def check_parts(self, member: Member) -> None:
        """Check that the parts of a robot fit the simulator and the worlds."""
        self.count_steps("controller.period_s", member.controller.period_s)
        for name, sensor in member.design.sensors.items():
            self.count_steps(f"design.sensors.{name}.period_s", sensor.period_s)
            self._check_measured(name, sensor)
        for name, world in self.world.items():
            _check_limit(name, world.course.time_limit_s, member.controller.period_s)

    def _check_measured(self, name: str, sensor: Sensor) -> None:
        offered = self.simulator.measures
        if sensor.measures not in offered:
            raise InputError(
                f"design.sensors.{name}: measures {sensor.measures}, which "
                f"{type(self.simulator).__name__} does not offer to sensors (it offers "
                f"{', '.join(offered)}); remove that sensor, or choose another simulator"
            )

    def count_steps(self, key: str, period: float) -> int:
        """Return the number of time steps in a period [s]; error messages name it ``key``."""
        step = self.simulator.time_step
        count = round(period / step)
        if count < 1 or not math.isclose(count * step, period, rel_tol=1e-9):
            nearest = max(1, count) * step
            raise InputError(
                f"{key}: must be a whole multiple of simulator.time_step ({step:g} s), "
                f"not {period:g} s; set it to {nearest:g}, or choose another step"
            )
        return count

    @property
    def is_live(self) -> bool:
        """True if an external program controls at least one robot."""
        return any(isinstance(member.controller, LiveController) for member in self.members)

    def equip(self, design: Design) -> tuple[Member, ...]:
        """Return the robots with a design's sensors and values; equal designs share them."""
        newest = self._newest
        if newest is None or newest[0] is not design:
            newest = vars(self)["_newest"] = design, self._equip(design)
        return newest[1]

    def _equip(self, design: Design) -> tuple[Member, ...]:
        known = [member.name for member in self.members]
        unknown = [name for name in design.parts if name not in known]
        if unknown:
            raise InputError(
                f"agents: the design has a part for {unknown[0]!r}, which is not an agent (agents: "
                f"{', '.join(filter(None, known)) or 'none'}); add the agent, or leave the part out"
            )
        parts = [member.find_design(design) for member in self.members]
        equipped = []
        for member, part in zip(self.members, parts, strict=True):
            try:
                equipped.append(member.with_design(part))
                self.check_parts(equipped[-1])
            except InputError as error:
                raise InputError(member.tell(error)) from None
        return tuple(equipped)

    def count_sensors(self, design: Design) -> list[tuple[int, float]]:
        """Return the number of sensors of each robot and their total configured price."""
        counts = []
        for member in self.members:
            mounts = member.find_design(design).mounts
            counts.append((len(mounts), add_prices(mounts, member.design.sensors)))
        return counts

    def name_columns(self, design: Design, world: str) -> list[str]:
        """Return the trajectory columns: the time, then each robot's, then each walker's."""
        columns = [TRAJECTORY[TIME]]
        for member in self.members:
            columns += member.name_columns(member.find_design(design))
        for walker in self.list_walkers(world):
            columns += [f"{WALKER}{walker}.{name}" for name in REPORT_COLUMNS]
        return columns


def _check_limit(world: str, limit: float, period: float) -> None:
    count = max(1, round(limit / period))
    if not math.isclose(count * period, limit, rel_tol=1e-9):
        raise InputError(
            f"world.{world}.course.time_limit_s: must be a whole multiple of "
            f"controller.period_s ({period:g} s), not {limit:g} s; set it to "
            f"{count * period:g}"
        )
