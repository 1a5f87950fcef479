"""One mission in MuJoCo: observe, sense, advance."""

from collections.abc import Sequence

from evoros.base import elementary
from evoros.base.arrays import CONTACT, DRIVE_SPEED, SPEED, STEERING, YAW, YAW_RATE, Array, X, Y
from evoros.base.errors import SimulationError
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_bodies import FIXED, MOVABLE, ROBOT
from evoros.simulator.engines.mujoco_model import Model, Settings
from evoros.simulator.engines.mujoco_rays import MujocoRays
from evoros.simulator.engines.mujoco_signals import MujocoSignals

HARMLESS = "Linesearch"
"""How the warning begins that a step of the solver was cut short; the next one goes on."""


class MujocoSimulation:
    """A robot of ``model`` in its world.

    The calls of the engine and the views of its state are bound once: looking them up costs as
    much as some of them.
    """

    def __init__(
        self,
        model: Model,
        robot: Robot,
        settings: Settings,
        warnings: Sequence[str],
        number: int = 0,  # of the robot
    ) -> None:
        library, engine, data = model.library, model.model, model.data
        self._drive, self._time_step = robot.drive, settings.time_step
        self._warnings = warnings  # the engine adds to them
        self._engine, self._data, self._model = engine, data, model
        self._step, self._place = library.mj_step, library.mj_kinematics
        self._parts = model.robots[number]
        position, rate = self._parts.root
        self._pose, self._rates = data.qpos[position : position + 7], data.qvel[rate : rate + 6]
        self._all_rates, self._list_touches = data.qvel, data.sensordata.tolist
        self._wheel_rates: tuple[float, ...] = (0.0,) * len(self._parts.rotors)
        self._command: tuple[float, float] | None = None
        self._touched = False  # since the last observation
        self._rays, self._ranges = MujocoRays(model, robot), robot.beam_count
        self._signals = MujocoSignals(model, robot, number)

    def observe(self, state: Array) -> None:
        """Fill ``state`` with the true state of the base link; contact is that since last time.

        Raises:
            SimulationError: the engine has warned of something that it cannot simulate.
        """
        if self._warnings:
            self._check_warnings()
        x, y, _, qw, qx, qy, qz = self._pose.tolist()
        vx, vy, _, wx, wy, wz = self._rates.tolist()  # the turning is about the link's own axes
        yaw = elementary.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        state[X], state[Y], state[YAW] = x, y, yaw
        state[YAW_RATE] = (
            2.0 * (qx * qz - qw * qy) * wx
            + 2.0 * (qy * qz + qw * qx) * wy
            + (1.0 - 2.0 * (qx * qx + qy * qy)) * wz
        )
        sin, cos = elementary.sin_cos(yaw)
        state[SPEED] = vx * cos + vy * sin
        state[CONTACT] = self._touched
        self._touched = False

    def _check_warnings(self) -> None:
        grave = [line for line in self._warnings if not line.startswith(HARMLESS)]
        if grave:
            raise SimulationError(f"MuJoCo: {' '.join(grave[0].split())}")

    def _touches(self) -> bool:
        """Whether the robot touches an obstacle. The engine lists contacts that overlap only."""
        pairs = self._engine.geom_group[self._data.contact.geom]
        obstacles = (pairs == FIXED) | (pairs == MOVABLE)
        return bool(((pairs == ROBOT) & obstacles[:, ::-1]).any())

    def sense(self, signals: Array) -> None:
        """Fill ``signals``: the nearest hit [m] of each beam, within its sensor's range, first."""
        self._place(self._engine, self._data)
        self.sense_placed(signals)

    def sense_placed(self, signals: Array) -> None:
        """Fill ``signals`` as ``sense`` does, if all shapes are where their links are."""
        self._rays.cast(self._pose, signals[: self._ranges])
        if self._rays.parts.exist:
            angles = self._data.qpos[self._parts.steering]
            self._rays.cast_at_parts(angles, signals[: self._ranges])
        self._signals.read(signals)

    def feel(self) -> None:
        """Let contact sensors feel what touches the robot after a step."""
        if self._signals.feels:
            self._signals.feel()

    def advance(self, command: Array, duration: float) -> None:
        """Drive with ``command`` for ``duration`` [s].

        Contact is tested in every step, because it may be shorter than a control period.
        """
        self.set_motors(command)
        step, engine, data, touches = self._step, self._engine, self._data, self._list_touches
        feels = self._signals.feels
        for _ in range(round(duration / self._time_step)):
            step(engine, data)
            if not self._touched and any(touches()) and self._touches():
                self._touched = True
            if feels and any(touches()):
                self._signals.feel()

    def set_motors(self, command: Array) -> None:
        """Let the motors follow a command, which is done before each control period."""
        speed, steering = float(command[DRIVE_SPEED]), float(command[STEERING])
        if self._command != (speed, steering):
            self._command = (speed, steering)
            angles, self._wheel_rates = self._drive.targets(speed, steering)
            self._data.ctrl[self._parts.servos] = angles
        self._all_rates[self._parts.rotors] = self._wheel_rates  # loads slow rotors a little

    def report_contact(self) -> None:
        """Let the next observation report contact."""
        self._touched = True
