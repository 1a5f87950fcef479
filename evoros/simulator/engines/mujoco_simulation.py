"""One mission in MuJoCo: observe, sense, advance."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evoros.base.arrays import CONTACT, DRIVE_SPEED, SPEED, STEERING, YAW, YAW_RATE, Array, X, Y
from evoros.base.errors import SimulationError
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_bodies import FIXED, MOVABLE, ROBOT, VISIBLE
from evoros.simulator.engines.mujoco_model import Model, Settings
from evoros.simulator.engines.rays import sensor_beams

HARMLESS = "Linesearch"
"""How the warning begins that a step of the solver was cut short; the next one goes on."""


class Span(NamedTuple):
    """The rays of one sensor within those of all; one call of the engine casts them."""

    first: int
    end: int  # one past the last
    range_max: float  # [m]


class MujocoSimulation:
    """The robot of ``model`` in its world.

    The calls of the engine and the views of its state are bound once: looking them up costs as
    much as some of them.
    """

    def __init__(
        self, model: Model, robot: Robot, settings: Settings, warnings: Sequence[str]
    ) -> None:
        library, engine, data = model.library, model.model, model.data
        self._drive, self._time_step = robot.drive, settings.time_step
        self._warnings = warnings  # the engine adds to them
        self._engine, self._data, self._model = engine, data, model
        self._step, self._cast = library.mj_step, library.mj_multiRay
        self._place = library.mj_kinematics
        position, rate = model.root
        self._pose, self._rates = data.qpos[position : position + 7], data.qvel[rate : rate + 6]
        self._all_rates, self._list_touches = data.qvel, data.sensordata.tolist
        self._wheel_rates: tuple[float, ...] = (0.0,) * len(model.rotors)
        self._command: tuple[float, float] | None = None
        self._touched = False  # since the last observation
        self._set_up_rays(robot)

    def _set_up_rays(self, robot: Robot) -> None:
        beams = sensor_beams(robot, robot.sensor_frames())
        ends = np.cumsum([0, *(len(beam.directions) for beam in beams)])
        self._spans = [
            Span(int(ends[part.start]), int(ends[part.stop]), beams[part.start].range_max)
            for part in robot.beam_layout
            if part.stop > part.start
        ]
        self._origins = np.array(
            [beams[p.start].origin for p in robot.beam_layout if p.stop > p.start]
        ).reshape(-1, 3)
        self._directions = np.concatenate([np.zeros((0, 3)), *(b.directions for b in beams)])
        self._firsts = ends[:-1]
        self._low = np.array([beam.range_min for beam in beams])
        self._high = np.array([beam.range_max for beam in beams])
        self._hits = np.zeros(ends[-1])
        self._seen = np.zeros(ends[-1], dtype=np.int32)

    def observe(self, state: Array) -> None:
        """Fill ``state`` with the true state of the base link; contact is that since last time.

        Raises:
            SimulationError: the engine has warned of something that it cannot simulate.
        """
        if self._warnings:
            self._check_warnings()
        x, y, _, qw, qx, qy, qz = self._pose.tolist()
        vx, vy, _, wx, wy, wz = self._rates.tolist()  # the turning is about the link's own axes
        yaw = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        state[X], state[Y], state[YAW] = x, y, yaw
        state[YAW_RATE] = (
            2.0 * (qx * qz - qw * qy) * wx
            + 2.0 * (qy * qz + qw * qx) * wy
            + (1.0 - 2.0 * (qx * qx + qy * qy)) * wz
        )
        state[SPEED] = vx * math.cos(yaw) + vy * math.sin(yaw)
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

    def sense(self, ranges: Array) -> None:
        """Fill ``ranges`` with the nearest hit [m] of each beam, within the sensor's range."""
        if not self._spans:
            return
        engine, data, cast = self._engine, self._data, self._cast
        self._place(engine, data)
        rotation, position = _frame(self._pose.tolist())
        directions = (self._directions @ rotation.T).ravel()
        origins = self._origins @ rotation.T + position
        hits, seen = self._hits, self._seen
        for origin, (first, end, range_max) in zip(origins, self._spans, strict=True):
            cast(
                engine,
                data,
                origin,
                directions[3 * first : 3 * end],
                VISIBLE,
                True,  # fixed shapes too
                -1,
                seen[first:end],
                hits[first:end],
                None,
                end - first,
                range_max,
            )
        hits[hits < 0.0] = np.inf  # -1: nothing
        nearest = np.minimum.reduceat(hits, self._firsts)
        ranges[:] = np.minimum(np.maximum(nearest, self._low), self._high)

    def advance(self, command: Array, duration: float) -> None:
        """Drive with ``command`` for ``duration`` [s].

        Contact is tested in every step, because it may be shorter than a control period.
        """
        speed, steering = float(command[DRIVE_SPEED]), float(command[STEERING])
        if self._command != (speed, steering):
            self._command = (speed, steering)
            angles, self._wheel_rates = self._drive.targets(speed, steering)
            self._data.ctrl[self._model.servos] = angles
        self._all_rates[self._model.rotors] = self._wheel_rates  # loads slow rotors a little
        step, engine, data, touches = self._step, self._engine, self._data, self._list_touches
        for _ in range(round(duration / self._time_step)):
            step(engine, data)
            if not self._touched and any(touches()) and self._touches():
                self._touched = True


def _frame(pose: Sequence[float]) -> tuple[Array, Array]:
    """Rotation (3, 3) and position (3,) [m] of the root link."""
    x, y, z, w, i, j, k = pose
    rotation = np.array(
        [
            [1 - 2 * (j * j + k * k), 2 * (i * j - k * w), 2 * (i * k + j * w)],
            [2 * (i * j + k * w), 1 - 2 * (i * i + k * k), 2 * (j * k - i * w)],
            [2 * (i * k - j * w), 2 * (j * k + i * w), 1 - 2 * (i * i + j * j)],
        ]
    )
    return rotation, np.array([x, y, z])
