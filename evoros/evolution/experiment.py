"""The description of a run: its parts, checked to fit together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated

from evoros.base.checks import COUNT, NAME, WHOLE, checked, instance_of, one_of
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.controller.protocol import Controller, LiveController
from evoros.design.space import DesignSpace, SensorDesign
from evoros.evolution.confirmation import A_CONFIRMATION, Confirmation
from evoros.executor.protocol import Executor
from evoros.failure.protocol import Failure
from evoros.fitness.protocol import Fitness
from evoros.mission.plan import CONFIRMATION, POLICIES, STOP, VALIDATION, WORST, Plan
from evoros.mission.scenario import Scenario
from evoros.optimizer.protocol import Optimizer, Search
from evoros.robot.model import Robot
from evoros.simulator.protocol import Simulator
from evoros.world.course import A_COURSE, Course
from evoros.world.model import World

CHAMPION, ALL, NONE = "champion", "all", "none"
"""Whose trajectories a run keeps."""


@dataclass(frozen=True)
@checked
class Experiment:
    """Everything that determines a run.

    The fields are named like the keys and groups of ``conf/config.yaml``. ``confirmation`` repeats
    missions of the best designs in another simulator, or by another controller. ``figures`` names
    subcommands of evoros-analyze, which draw the finished run. The worlds' courses may refer to the
    values of ``course``.

    Raises:
        InputError: a value out of range, a part of the wrong kind, parts that do not fit.
    """

    robot: Robot
    world: Mapping[str, World]
    design: SensorDesign
    failure: Failure
    controller: Controller | LiveController
    simulator: Simulator
    fitness: Annotated[Fitness, instance_of(Fitness, "a fitness (score and worst)")]
    optimizer: Annotated[Optimizer, instance_of(Optimizer, "an optimizer (generations and start)")]
    executor: Annotated[Executor, instance_of(Executor, "an executor (workers and open)")]
    seed: Annotated[int, WHOLE] = 0
    trials: Annotated[int, COUNT] = 1  # missions of a design in each world
    draws: Annotated[str, one_of(*POLICIES)] = "generation"  # where missions share random draws
    lost_missions: Annotated[str, one_of(STOP, WORST)] = STOP  # if a mission crashes or hangs
    record: Annotated[str, one_of(CHAMPION, ALL, NONE)] = CHAMPION  # whose trajectories are kept
    confirmation: Annotated[Confirmation | None, A_CONFIRMATION] = None
    figures: Sequence[str] = ()
    course: Annotated[Course | None, A_COURSE] = None

    def __post_init__(self) -> None:
        _ = self.confirming  # checks that the parts fit together
        for name in self.world:
            if not NAME.holds(name):
                raise InputError(
                    f"world: the key of each world must be {NAME.text}, not {name!r}; rename it"
                )

    @cached_property
    def scenario(self) -> Scenario:
        """The parts that missions need, with the run's own simulator."""
        return Scenario(
            self.robot, self.world, self.design, self.failure, self.controller, self.simulator
        )

    @cached_property
    def confirming(self) -> Scenario:
        """The parts with which missions are confirmed; ``scenario`` if there is no confirmation.

        Raises:
            InputError: the time step of that simulator does not fit the periods.
        """
        confirmation = self.confirmation
        if confirmation is None:
            return self.scenario
        controller = confirmation.controller or self.controller
        try:
            return replace(self.scenario, simulator=confirmation.simulator, controller=controller)
        except InputError as error:
            key = "confirmation" if confirmation.controller else "confirmation.simulator"
            raise InputError(f"{key}: {error}") from None

    def scenario_for(self, purpose: str) -> Scenario:
        """Return ``confirming`` for confirmation and validation, and ``scenario`` otherwise.

        So validated and confirmed fitness are comparable.
        """
        return self.confirming if purpose in (CONFIRMATION, VALIDATION) else self.scenario

    @cached_property
    def space(self) -> DesignSpace:
        """The search space."""
        return self.design.bind(self.robot)

    def start_search(self) -> Search:
        """Start the search of this experiment, which its seed determines."""
        return self.optimizer.start(self.space, generator(f"{self.seed}", "optimizer"))

    @cached_property
    def plan(self) -> Plan:
        """The missions that score a design."""
        return Plan(
            self.seed,
            tuple(self.world),
            self.trials,
            self.optimizer.validation_trials,
            self.draws,
        )
