"""Conformance tests for controllers, layers, live controllers and localizations."""

import math
from collections.abc import Iterator, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from evoros.base.arrays import COMMAND_SIZE, LEG_SIZE, STATE_SIZE, Array
from evoros.base.rng import generator
from evoros.compilation.rules import FILTER, LAYER
from evoros.controller.protocol import (
    ESTIMATOR_ARGUMENTS,
    LAYER_ARGUMENTS,
    Briefing,
    Controller,
    Estimator,
    Layer,
    LiveController,
    StartedLayer,
)
from evoros.robot.model import Robot
from evoros.testing.part import PartSuite
from evoros.testing.rules import PERIOD_S, TICKS, RuleCase, RuleSuite
from evoros.testing.subjects import example_robot, example_world

SILENT_TICK = 2


class _OnRobot(PartSuite):
    @cached_property
    def robot(self) -> Robot:
        """The robot with its sensors; override if the part requires a different robot."""
        return example_robot()


class _ControllerSuite(_OnRobot):
    def test_its_modes_and_period_are_possible(self) -> None:
        """Modes are non-empty strings, and the period is finite and positive."""
        modes = self.part.modes
        assert modes, "a controller must have at least one mode"
        strings = all(isinstance(mode, str) and mode for mode in modes)
        assert strings, f"modes must be strings: {modes}"
        assert 0 < self.part.period_s < math.inf, f"period_s must not be {self.part.period_s}"


class _LayersSuite(_OnRobot, RuleSuite):
    signature: ClassVar[Any] = LAYER
    fills = "command"

    def start_layers(self, part: Any, seed: int) -> Sequence[StartedLayer]:
        raise NotImplementedError

    def start_rules(self, part: Any, seed: int) -> Sequence[RuleCase]:
        """Start all layers."""
        lengths = {"readings": self.robot.channel_count}
        return [
            RuleCase(layer.rule, LAYER_ARGUMENTS, layer.started, lengths)
            for layer in self.start_layers(part, seed)
        ]

    def test_commands_are_finite(self) -> None:
        """A layer that decides gives a finite command, even without readings or a pose."""
        for case in self.start_rules(self.part, 1):
            for silent in ((), ("readings",), ("state",), ("readings", "state")):
                rule, inputs, rng = case.bind(), np.random.default_rng(1), generator("", "")
                for tick in range(TICKS):
                    given = case.draw(inputs, rng, tick * PERIOD_S)
                    for name in silent:
                        given[name][:] = math.nan
                    decides, command = rule(*given.values()), given["command"]
                    finite, lost = np.isfinite(command).all(), " and ".join(silent) or "no input"
                    assert not decides or finite, f"{command} must be finite if {lost} is missing"


class LayerSuite(_LayersSuite):
    """Conformance tests for a controller layer, on the rover with six sonars."""

    part: Layer
    protocol = Layer

    def start_layers(self, part: Layer, seed: int) -> Sequence[StartedLayer]:
        """Start the layer."""
        rng = generator(str(seed), part.mode)
        return [StartedLayer(part.rule, part.start(self.lend(self.robot), PERIOD_S, rng))]

    def test_its_mode_can_be_recorded(self) -> None:
        """The mode is a non-empty string."""
        assert isinstance(self.part.mode, str), "mode must be a string"
        assert self.part.mode, "mode must not be empty"

    def test_it_answers_whether_it_decides(self) -> None:
        """The rule returns True or False."""
        for case in self.start_rules(self.part, 1):
            given = case.draw(np.random.default_rng(1), generator("", ""), 0.0)
            answer = case.bind()(*given.values())
            assert isinstance(answer, bool | np.bool_), f"the rule must not return {answer!r}"


class ControllerSuite(_LayersSuite, _ControllerSuite):
    """Conformance tests for a controller made of layers."""

    part: Controller
    protocol = Controller

    def start_layers(self, part: Controller, seed: int) -> Sequence[StartedLayer]:
        """Open the controller for one mission."""
        with part.open(self.lend(self.robot), partial(generator, str(seed))) as layers:
            return list(layers)

    def test_it_has_a_mode_for_each_layer(self) -> None:
        """There is one mode per layer, in the same order."""
        modes, count = self.part.modes, len(self.start_layers(self.part, 1))
        assert len(modes) == count, f"there must be {count} modes, one for each layer, not {modes}"


class EstimatorSuite(_OnRobot, RuleSuite):
    """Conformance tests for a localization that computes the pose from readings."""

    part: Estimator
    protocol = Estimator
    signature: ClassVar[Any] = FILTER
    fills = "pose"

    def start_rules(self, part: Estimator, seed: int) -> Sequence[RuleCase]:
        """Start the localization."""
        started = part.start_estimate(self.lend(self.robot), PERIOD_S)
        lengths = {"readings": self.robot.channel_count}
        return [RuleCase(part.rule, ESTIMATOR_ARGUMENTS, started, lengths)]


class LiveControllerSuite(_ControllerSuite):
    """Conformance tests for a controller in a separate process, on the rover with six sonars."""

    part: LiveController
    protocol = LiveController

    def use(self, part: LiveController, seed: int) -> Iterator[tuple[int, Array]]:
        """Launch the controller and exchange values, once without a localized pose."""
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

    def test_its_files_exist(self) -> None:
        """All files exist, so that runs can record their digests."""
        for file in self.part.files:
            assert Path(file).is_file(), f"{file} must be an existing file"

    def test_its_answers_are_finite(self) -> None:
        """Commands are finite, and each mode is from 0 to the number of modes."""
        for mode, command in self.use(self.part, 1):
            assert 0 <= mode <= len(self.part.modes), f"there is no mode {mode}"
            assert np.isfinite(command).all(), f"the command must be finite, not {command}"
