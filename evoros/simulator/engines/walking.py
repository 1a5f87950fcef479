"""The walkers of a mission in a rigid-body engine, moved by ``evoros.walkers``."""

from collections.abc import Sequence

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import STATE_SIZE, YAW, Array, X, Y
from evoros.base.packing import unpack
from evoros.compilation.rules import A1, A2, F8, NOTHING, compile_rule
from evoros.robot.model import Robot
from evoros.walkers.crowd import Crowd, note_touch, report_walkers
from evoros.walkers.layout import Walking
from evoros.walkers.motion import walk

_PLAN = NOTHING(A1, A1, A2, F8, A2)
_REPORT = NOTHING(A1, A1)
GAP_M = 1e-3  # gap [m] between walkers and ground


class EngineWalkers:
    """Walkers that move in each step, and react to robot poses at the start of a control period."""

    def __init__(self, crowd: Crowd, robots: Sequence[Robot], time_step: float) -> None:
        self._parameters, self._memory = crowd.parameters, crowd.memory.copy()
        self._time_step, self._robots = time_step, len(robots)
        self._plan, self._report = compile_rule(plan, _PLAN), compile_rule(report, _REPORT)
        self._poses = np.zeros((len(robots), 4))
        self.sizes = crowd.sizes

    @property
    def places(self) -> Array:
        """The positions (n, 2) [m] of the walkers."""
        return unpack(Walking, self._memory).places

    def observe(self, states: Array) -> None:
        """Read the robot poses in ``states``, and write the reports of the walkers after them."""
        for robot in range(self._robots):
            state = states[STATE_SIZE * robot :]
            sin, cos = elementary.sin_cos(float(state[YAW]))
            self._poses[robot] = state[X], state[Y], cos, sin
        self._report(self._memory, states[STATE_SIZE * self._robots :])

    def move(self, steps: int) -> Array:
        """Move the walkers; return their positions (steps, 2 n) [m] after each step."""
        ways = np.zeros((steps, 2 * len(self.sizes)))
        self._plan(self._parameters, self._memory, self._poses, self._time_step, ways)
        return ways

    def touch(self, walker: int, robot: int) -> None:
        """Record that a walker has touched a robot."""
        note_touch(unpack(Walking, self._memory), walker, robot)


def plan(parameters: Array, memory: Array, robots: Array, step: float, ways: Array) -> None:
    """Move the walkers, and write their positions after each step."""
    places = unpack(Walking, memory).places
    for k in range(len(ways)):
        walk(parameters, memory, robots, step)
        for i in range(len(places)):
            ways[k, 2 * i] = places[i, 0]
            ways[k, 2 * i + 1] = places[i, 1]


def report(memory: Array, reports: Array) -> None:
    """Write the reports of the walkers."""
    report_walkers(unpack(Walking, memory), reports)
