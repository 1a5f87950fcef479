"""The checks of controllers outside of this process."""

import math
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import numpy as np

from evoros.base.arrays import COMMAND_SIZE, LEG_SIZE, STATE_SIZE, Array
from evoros.controller.protocol import Briefing, LiveController
from evoros.robot.model import Robot
from evoros.testing.part import PartSuite
from evoros.testing.rules import PERIOD_S, TICKS
from evoros.testing.subjects import example_robot, example_world

SILENT_TICK = 2


class LiveControllerSuite(PartSuite):
    """The checks of a controller in a process of its own, on the rover with six sonars."""

    part: LiveController
    protocol = LiveController

    @cached_property
    def robot(self) -> Robot:
        """The robot with its sensors; set another one if the controller needs it."""
        return example_robot()

    def use(self, part: LiveController, seed: int) -> Iterator[tuple[int, Array]]:
        """Launch it for a mission, and exchange some values; the localization is silent once."""
        robot, rng = self.robot, np.random.default_rng(seed)
        home, route = example_world().course.home, np.array([[3.0, 0.0], [0.0, 0.0]])
        briefing = self.lend(Briefing(robot, home, route, 0.5, 60.0, seed))
        with part.launch(briefing) as pilot:
            for tick in range(TICKS):
                state = rng.uniform(-1.0, 1.0, STATE_SIZE)
                state[:] = math.nan if tick == SILENT_TICK else state
                given = (
                    self.lend(state),
                    self.lend(rng.uniform(-5.0, 5.0, LEG_SIZE)),
                    self.lend(rng.choice([0.3, 4.5, math.nan], robot.channel_count)),
                )
                command = np.zeros(COMMAND_SIZE)
                mode = pilot.exchange(tick * PERIOD_S, *given, command)
                yield mode, command

    def test_its_modes_and_period_are_possible(self) -> None:
        """Modes are texts, and the period is greater than 0."""
        modes = self.part.modes
        assert modes, "a controller must have a mode"
        assert all(isinstance(mode, str) and mode for mode in modes), f"modes are {modes}"
        assert 0 < self.part.period_s < math.inf, f"period_s is {self.part.period_s}"

    def test_its_files_exist(self) -> None:
        """A run records their hashes."""
        for file in self.part.files:
            assert Path(file).is_file(), f"{file} must be a file"

    def test_its_answers_are_finite(self) -> None:
        """A command has numbers, and a mode is one of its modes, or 0."""
        for mode, command in self.use(self.part, 1):
            assert 0 <= mode <= len(self.part.modes), f"the mode is {mode}"
            assert np.isfinite(command).all(), f"the command is {command}"
