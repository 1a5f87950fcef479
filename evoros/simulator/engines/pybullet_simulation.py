"""One mission in PyBullet: observe, sense, advance."""

import math
from collections.abc import Sequence

import numpy as np

from evoros.base.arrays import CONTACT, Array
from evoros.drive.weak_wheels import find_targets
from evoros.robot.model import Robot
from evoros.simulator.engines.pybullet_model import AT_REST, Engine, Model, Settings
from evoros.simulator.engines.pybullet_rays import BulletRays
from evoros.simulator.engines.pybullet_signals import BulletSignals, find_touches
from evoros.simulator.engines.rigid_signals import fill_state
from evoros.simulator.engines.servos import lag_gain
from evoros.simulator.engines.teams import read_command, share_arrays
from evoros.simulator.engines.walking import GAP_M, EngineWalkers
from evoros.walkers.crowd import Crowd

FINE_STEP_S = 0.0025
"""The step while a movable body moves. The engine finds one contact with a plane in a step, and
keeps it until the body has slid by 2 % of its size. At long steps, which lose their contacts at
once, a body rests on one corner at a time, and sinks."""

NEAR_STEPS = 2.0
"""The way of the robot before it touches a body, in long steps, on which they are fine."""


class PyBulletSimulation:
    """The robots of ``model`` in their world, in steps that they make together."""

    def __init__(
        self,
        engine: Engine,
        model: Model,
        robots: Sequence[Robot],
        settings: Settings,
        crowd: Crowd | None = None,
    ) -> None:
        self._bullet, self._model = engine.bullet, model
        self._time_step = settings.time_step
        self._finer = math.ceil(settings.time_step / FINE_STEP_S - 1e-9)  # steps that replace one
        self._substeps = 1
        self._vehicles = [
            _Vehicle(engine, model, robot, settings, i) for i, robot in enumerate(robots)
        ]
        self._turns = list(zip(self._vehicles, share_arrays(robots), strict=True))
        self._walkers = None
        if crowd is not None:
            self._walkers = EngineWalkers(crowd, robots, settings.time_step)
            self._place(self._walkers, self._walkers.places.ravel())

    def observe(self, state: Array) -> None:
        """Fill ``state`` with the true states; contact is that since last time."""
        for vehicle, share in self._turns:
            vehicle.observe(state[share.state])
        if self._walkers is not None:
            self._walkers.observe(state)

    def sense(self, signals: Array) -> None:
        """Fill ``signals``; robots see one another, and not themselves."""
        for vehicle, share in self._turns:
            vehicle.sense(signals[share.signals])

    def advance(self, command: Array, duration: float) -> None:
        """Drive with ``command`` for ``duration`` [s]; a contact may last a single step."""
        for vehicle, share in self._turns:
            vehicle.take(read_command(command, share))
        step, vehicles, walkers = self._bullet.stepSimulation, self._vehicles, self._walkers
        steps = round(duration / self._time_step)
        ways = None if walkers is None else walkers.move(steps)
        for k in range(steps):
            if walkers is not None and ways is not None:
                self._place(walkers, ways[k])
            if self._model.watched:
                self._adapt_step()
            for _ in range(self._substeps):
                step()
                for vehicle in vehicles:
                    vehicle.report_contact()
                if walkers is not None:
                    self._note_touches(walkers)

    def _place(self, walkers: EngineWalkers, places: Array) -> None:
        """Move the walkers to places (2 n,) [m]."""
        for body, index in self._model.walkers.items():
            x, y = places[2 * index : 2 * index + 2].tolist()
            z = walkers.sizes[index][1] / 2.0 + GAP_M
            self._bullet.resetBasePositionAndOrientation(body, (x, y, z), (0, 0, 0, 1))

    def _note_touches(self, walkers: EngineWalkers) -> None:
        """Keep which walkers touch robots after a step."""
        for robot, loaded in enumerate(self._model.robots):
            for _, point in find_touches(self._bullet, loaded, self._model.ground):
                if point[2] in self._model.walkers:
                    walkers.touch(self._model.walkers[point[2]], robot)

    def _adapt_step(self) -> None:
        """Divide the step while a body is disturbed."""
        disturbed = any(vehicle.is_disturbed() for vehicle in self._vehicles)
        substeps = self._finer if disturbed else 1
        if substeps != self._substeps:
            self._substeps = substeps
            self._bullet.setTimeStep(self._time_step / substeps)
            for vehicle in self._vehicles:
                vehicle.adapt_gain(self._time_step / substeps)


class _Vehicle:
    """One of the robots."""

    def __init__(
        self, engine: Engine, model: Model, robot: Robot, settings: Settings, index: int
    ) -> None:
        bullet = engine.bullet
        self._bullet, self._model = bullet, model
        self._robot = model.robots[index]
        self._drive, self._lag = robot.drive, settings.steering_lag_s
        self._step = settings.time_step
        self._gap = NEAR_STEPS * robot.drive.max_speed_mps * settings.time_step
        self._reach = self._gap + 2.0 * float(np.linalg.norm(robot.outline, axis=1).max())
        self._command: tuple[float, ...] | None = None
        self._touched = False  # since the last observation
        self._rays, self._ranges = BulletRays(bullet, self._robot, robot), robot.beam_count
        self._signals = BulletSignals(bullet, model, robot, index)

    def observe(self, state: Array) -> None:
        bullet, robot = self._bullet, self._robot
        place, facing = bullet.getBasePositionAndOrientation(robot.body)
        velocity, (_, _, yaw_rate) = bullet.getBaseVelocity(robot.body)
        place, quaternion = bullet.multiplyTransforms(place, facing, *robot.to_base)
        fill_state(state, place, quaternion, velocity, yaw_rate)
        state[CONTACT] = self._touched
        self._touched = False

    def sense(self, signals: Array) -> None:
        self._rays.cast(signals[: self._ranges])
        self._signals.read(signals)

    def take(self, command: tuple[float, ...]) -> None:
        """Set the motors if the command is a new one."""
        if self._command != command:
            self._command = command
            self._set_motors(command)

    def report_contact(self) -> None:
        """Let the next observation report contact if the robot touches an obstacle."""
        if not self._touched:
            self._touched = any(find_touches(self._bullet, self._robot, self._model.ground))
        if self._signals.feels:
            self._signals.feel()

    def is_disturbed(self) -> bool:
        """Whether a body moves or is about to be pushed by this robot."""
        return any(map(self._is_disturbed, self._model.watched))

    def adapt_gain(self, step: float) -> None:
        """Set the motors for another step [s], because their gains count per step."""
        self._step = step
        if self._command is not None:
            self._set_motors(self._command)

    def _is_disturbed(self, body: int) -> bool:
        """Whether a movable body moves, or is so near that the robot may reach it in this step."""
        bullet, robot = self._bullet, self._robot.body
        if bullet.getBaseVelocity(body) != AT_REST:
            return True
        (x, y, _), _ = bullet.getBasePositionAndOrientation(robot)
        (bx, by, _), _ = bullet.getBasePositionAndOrientation(body)
        reach = self._reach + self._model.watched[body]
        if (bx - x) * (bx - x) + (by - y) * (by - y) > reach * reach:
            return False
        return bool(bullet.getClosestPoints(robot, body, self._gap))

    def _set_motors(self, command: tuple[float, ...]) -> None:
        bullet, robot = self._bullet, self._robot
        angles, rates = find_targets(self._drive, *command)
        if angles:
            # By the engine's own constant gain the lag would be ten steps, however long they are.
            gain = lag_gain(self._step, self._lag)
            bullet.setJointMotorControlArray(
                robot.body,
                robot.steering,
                bullet.POSITION_CONTROL,
                targetPositions=angles,
                forces=robot.steering_forces,
                positionGains=(gain,) * len(angles),
            )
        bullet.setJointMotorControlArray(
            robot.body,
            robot.wheels,
            bullet.VELOCITY_CONTROL,
            targetVelocities=rates,
            forces=robot.wheel_forces,
        )
