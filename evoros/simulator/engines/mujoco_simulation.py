"""A mission in MuJoCo: observe, sense and advance."""

import re
from collections.abc import Sequence

import numpy as np

from evoros.base.arrays import CONTACT, Array, product
from evoros.base.errors import SimulationError
from evoros.drive.protocol import find_targets
from evoros.robot.model import Robot
from evoros.simulator.engines import mujoco_bodies
from evoros.simulator.engines.mujoco_bodies import FIXED, MOVABLE
from evoros.simulator.engines.mujoco_model import Model, Settings
from evoros.simulator.engines.mujoco_rays import MujocoSight, root_frame
from evoros.simulator.engines.rigid_signals import Motion, RigidSignals, fill_state
from evoros.simulator.engines.teams import name_robot, read_command, share_arrays
from evoros.simulator.engines.walking import EngineWalkers
from evoros.walkers.crowd import Crowd


class MujocoSignals(RigidSignals):
    """The signals of a robot in a MuJoCo model."""

    def __init__(self, model: Model, robot: Robot, index: int) -> None:
        engine, data, parts = model.model, model.data, model.robots[index]
        super().__init__(robot, -float(engine.opt.gravity[2]))
        self._data = data
        # Contacts with the ground and between parts of one robot are ignored.
        self._ours = np.isin(np.arange(engine.ngeom), parts.visible)
        self._theirs = (engine.geom_group != mujoco_bodies.GROUND) & ~self._ours
        position, rate = parts.root
        self._pose, self._rates = data.qpos[position : position + 7], data.qvel[rate : rate + 6]
        self._angles = parts.wheels

    def read(self, signals: Array) -> None:
        """Write the robot's readings into their slices of ``signals``."""
        if self.exist:
            rotation, position = root_frame(self._pose)
            # angular velocity in link axes
            motion = Motion(position, rotation, self._rates[:3], product(rotation, self._rates[3:]))
            self.fill(signals, motion, self._data.qpos[self._angles])

    def feel(self) -> None:
        """Count this step for each contact zone in which something touches the robot."""
        contact = self._data.contact
        ours, theirs = self._ours[contact.geom], self._theirs[contact.geom]
        felt = (ours & theirs[:, ::-1]).any(axis=1)
        if not felt.any():
            return
        rotation, position = root_frame(self._pose)
        points = (product(contact.pos[felt] - position, rotation))[:, :2]
        pairs = contact.geom[felt]
        self.touch(points[(pairs == pair).all(axis=1)] for pair in np.unique(pairs, axis=0))


HARMLESS = "Linesearch"  # warnings of truncated solver steps, which the next step corrects
_PLACE = re.compile(r" at DOF (\d+)")  # degree of freedom named in a warning

GROUND, OBSTACLE, WALKER = -1, -2, -3  # owners of shapes; walkers are numbered -3, -4, and so on


class MujocoSimulation:
    """The robots of a MuJoCo model in a world."""

    def __init__(
        self,
        model: Model,
        robots: Sequence[Robot],
        settings: Settings,
        warnings: Sequence[str],
        crowd: Crowd | None = None,
    ) -> None:
        library, engine = model.library, model.model
        self._model, self._robots, self._time_step = model, robots, settings.time_step
        self._warnings = warnings  # list to which the engine appends
        self._step, self._place = library.mj_step, library.mj_kinematics
        self._list_touches = model.data.sensordata.tolist
        self._vehicles = [_Vehicle(model, robot, i) for i, robot in enumerate(robots)]
        self._turns = list(zip(self._vehicles, share_arrays(robots), strict=True))
        groups = engine.geom_group
        self._owners = np.where((groups == FIXED) | (groups == MOVABLE), OBSTACLE, GROUND)
        for index, parts in enumerate(model.robots):
            self._owners[parts.visible] = index
        self._owners[model.walkers] = WALKER - np.arange(len(model.walkers))
        self._walkers = None
        if crowd is not None:
            self._walkers = EngineWalkers(crowd, robots, settings.time_step)
            model.place_walkers(self._walkers.places)

    def observe(self, state: Array) -> None:
        """Fill ``state`` with the base links' true states, and contacts since the last call."""
        grave = [line for line in self._warnings if not line.startswith(HARMLESS)]
        if grave:
            raise SimulationError(self._name_place(f"MuJoCo: {' '.join(grave[0].split())}"))
        for vehicle, share in self._turns:
            vehicle.observe(state[share.state])
        if self._walkers is not None:
            self._walkers.observe(state)

    def _name_place(self, warning: str) -> str:
        place = _PLACE.search(warning)
        if place is None or len(self._robots) == 1:
            return warning
        firsts = [parts.root[1] for parts in self._model.robots]
        index = sum(first <= int(place[1]) for first in firsts) - 1
        return f"{name_robot(index, self._robots[index])}: {warning}" if index >= 0 else warning

    def sense(self, signals: Array) -> None:
        """Fill ``signals``; range sensors detect other robots but not their own."""
        engine, data = self._model.model, self._model.data
        self._place(engine, data)
        for vehicle, share in self._turns:
            vehicle.sense(signals[share.signals])

    def advance(self, command: Array, duration: float) -> None:
        """Apply ``command`` for ``duration`` [s], checking contacts after each step."""
        for vehicle, share in self._turns:
            vehicle.set_motors(read_command(command, share))
        step, engine, data = self._step, self._model.model, self._model.data
        touches, steps = self._list_touches, round(duration / self._time_step)
        ways = None if self._walkers is None else self._walkers.move(steps)
        for k in range(steps):
            if ways is not None:
                self._model.place_walkers(ways[k])
            step(engine, data)
            if any(touches()):
                self._report_contacts()

    def _report_contacts(self) -> None:
        vehicles, walkers = self._vehicles, self._walkers
        if walkers is not None or not all(vehicle.touched for vehicle in vehicles):
            for pair in self._owners[self._model.data.contact.geom].tolist():
                if GROUND not in pair:
                    for index in pair:
                        if index >= 0:
                            vehicles[index].touched = True
                    if walkers is not None and min(pair) <= WALKER <= 0 <= max(pair):
                        walkers.touch(WALKER - min(pair), max(pair))
        for vehicle in vehicles:
            vehicle.feel()


class _Vehicle:
    def __init__(self, model: Model, robot: Robot, index: int) -> None:
        self._drive, self._data, self._parts = robot.drive, model.data, model.robots[index]
        position, rate = self._parts.root
        data = model.data
        self._pose, self._rates = data.qpos[position : position + 7], data.qvel[rate : rate + 6]
        self._all_rates = data.qvel
        self._wheel_rates: tuple[float, ...] = (0.0,) * len(self._parts.rotors)
        self._command: tuple[float, ...] | None = None
        self.touched = False  # whether a contact has occurred since the last observation
        self._sight, self._ranges = MujocoSight(model, robot, index), robot.beam_count
        self._signals = MujocoSignals(model, robot, index)

    def observe(self, state: Array) -> None:
        x, y, _, qw, qx, qy, qz = self._pose.tolist()
        vx, vy, _, wx, wy, wz = self._rates.tolist()  # angular velocity in link axes
        yaw_rate = (
            2.0 * (qx * qz - qw * qy) * wx
            + 2.0 * (qy * qz + qw * qx) * wy
            + (1.0 - 2.0 * (qx * qx + qy * qy)) * wz
        )
        fill_state(state, (x, y), (qx, qy, qz, qw), (vx, vy), yaw_rate)
        state[CONTACT] = self.touched
        self.touched = False

    def sense(self, signals: Array) -> None:
        """Fill ``signals``; the engine must have updated the poses of the shapes."""
        self._sight.cast(signals[: self._ranges])
        self._signals.read(signals)

    def feel(self) -> None:
        """Update the contact sensors after a step."""
        if self._signals.feels:
            self._signals.feel()

    def set_motors(self, command: tuple[float, ...]) -> None:
        """Set the motor targets of a command, before each control period."""
        if self._command != command:
            self._command = command
            angles, self._wheel_rates = find_targets(self._drive, *command)
            self._data.ctrl[self._parts.servos] = angles
        self._all_rates[self._parts.rotors] = self._wheel_rates  # loads slow the rotors slightly
