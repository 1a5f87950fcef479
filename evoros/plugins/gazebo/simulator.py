"""Rigid-body physics in Gazebo's library with DART, in a separate process.

``docs/simulation.md`` gives the reasons for the set-up.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated

from evoros.base.checks import LEAST_STEP_S, NOT_NEGATIVE, POSITIVE, checked, number_between
from evoros.base.errors import InputError, LaunchError
from evoros.drive.protocol import Drive
from evoros.drive.wheels import skids
from evoros.plugins.gazebo.gazebo_world import hold_standing
from evoros.plugins.gazebo.server import Engine, compile_server, find_library
from evoros.plugins.gazebo.simulation import GazeboSimulation
from evoros.sensor.protocol import RANGE, SIGNAL_SIZES
from evoros.simulator.engines.idle import IdleEngines
from evoros.simulator.engines.mujoco_model import Models, Settings, count_movable
from evoros.simulator.engines.teams import MAX_ROBOTS, check_number
from evoros.simulator.mujoco import import_mujoco
from evoros.simulator.protocol import PlacedRobot, Simulator
from evoros.world.model import World

MAX_STEP_S = 0.025
"""The longest step at which the rover drives within 1 % of its geometry (``docs/fidelity.md``)."""

MOST_MOVABLE = 500
"""Maximum number of movable bodies; DART takes 25 us for each in every step, even at rest."""

_RAYS = Settings(time_step=0.01, wheel_friction=1.0, steering_lag_s=0.0)
"""Settings of the ray-casting model, in which nothing moves by itself."""

IDLE: IdleEngines[Engine] = IdleEngines()


@dataclass(frozen=True)
@checked
class Gazebo(Simulator):
    """The simulator of Gazebo's physics.

    Raises:
        InputError: a value is out of range, or the library or a compiler is not installed.
    """

    time_step: Annotated[float, number_between(LEAST_STEP_S, MAX_STEP_S)] = 0.005  # [s]
    wheel_friction: Annotated[float, POSITIVE] = 1.0  # the ground's applies if smaller
    steering_lag_s: Annotated[float, NOT_NEGATIVE] = 0.05  # time constant of the servos
    answer_limit_s: Annotated[float, POSITIVE] = 60.0
    """Wall-clock limit of a control period or of opening a world."""
    versions: Mapping[str, str] = field(
        init=False, compare=False, default_factory=lambda: find_library().versions
    )
    """Versions of the system libraries on this machine; workers may run on others."""
    packages = ("mujoco-core",)
    measures = (RANGE, *SIGNAL_SIZES)
    max_robots = MAX_ROBOTS
    has_walkers = True
    weakens_wheels = True

    def _require_versions(self) -> None:
        try:
            found = find_library().versions
        except InputError as error:
            raise LaunchError(str(error)) from error
        for name, version in self.versions.items():
            if found.get(name) != version:
                raise LaunchError(
                    f"simulator=gazebo: a worker must have {name} {version} like the main process, "
                    f"not {found.get(name) or 'none'}; install the same release there"
                )

    def check_world(self, world: World) -> None:
        """Refuse worlds with too many movable bodies.

        Raises:
            InputError: there are more than ``MOST_MOVABLE``.
        """
        count = count_movable(hold_standing(world, robots=1))
        if count > MOST_MOVABLE:
            raise InputError(
                f"must have at most {MOST_MOVABLE} bodies that move for simulator=gazebo, not "
                f"{count}, because its engine computes all of them in every step; make some bodies "
                f"static, or use simulator=mujoco"
            )

    def doubt_drive(self, drive: Drive) -> str:
        """Return why no step is accurate for skid steering, or an empty string."""
        if not skids(drive):
            return ""
        return (
            "Gazebo's DART limits friction along two axes of the world, so that the heading of a "
            "skid-steer robot changes how fast it turns"
        )

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[GazeboSimulation]:
        """Place each robot at its home.

        Raises:
            InputError: the server cannot be compiled.
            LaunchError: the library differs from the main process's library.
            SimulationError: Gazebo refuses a robot or the world, or there are too many robots.
            PilotLost: the server ended or hangs.
        """
        check_number(robots)
        self._require_versions()
        settings = Settings(self.time_step, self.wheel_friction, self.steering_lag_s)
        held = hold_standing(world, len(robots)).with_crowd(world.crowd)
        alone = [robot for robot, _ in robots]
        rays = None
        if any(robot.beam_count for robot in alone):
            rays = _models().prepare(robots, held, _RAYS)
        with IDLE.take(lambda: Engine(compile_server(), self.answer_limit_s)) as engine:
            engine.limit(self.answer_limit_s)
            scene = engine.prepare(robots, held, settings)
            yield GazeboSimulation(scene, rays, alone, held, settings)


@cache
def _models() -> Models:
    """Return the ray-casting models that this process keeps; no result depends on them."""
    return Models(import_mujoco())
