"""The description of a run: its parts, checked to fit together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any

from evoros.allocation.once import Once
from evoros.allocation.protocol import Allocation
from evoros.base.checks import COUNT, NAME, SEED, checked, instance_of, mapping_of, one_of
from evoros.base.combining import Combine, mean
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.certificate.confirmation import A_CONFIRMATION, Confirmation
from evoros.certificate.final_choice import A_FINAL_CHOICE, AN_ALLOCATION, FinalChoice
from evoros.certificate.validation import A_VALIDATION, Validation
from evoros.controller.protocol import Controller, LiveController
from evoros.design.space import SensorDesign
from evoros.design.team import TeamSpace
from evoros.evolution.agent import Agent
from evoros.evolution.team_check import check_team, make_room
from evoros.evolution.treatment import TREATMENT
from evoros.executor.protocol import Executor
from evoros.failure.protocol import PARTS, AdaptiveFailure, Failure, list_parts
from evoros.filter.protocol import POSE
from evoros.fitness.protocol import Fitness
from evoros.fitness.scoring import Scoring
from evoros.measure.protocol import Measure
from evoros.mission.member import Member
from evoros.mission.plan import (
    CONFIRMATION,
    EVALUATION,
    FINAL,
    POLICIES,
    STOP,
    VALIDATION,
    WORST,
    Plan,
)
from evoros.mission.scenario import Scenario
from evoros.observers.protocol import OBSERVERS, Observer
from evoros.optimizer.protocol import Goals, Optimizer, Search
from evoros.requirement.requirements import REQUIREMENTS, Requirement, check_requirements
from evoros.robot.model import Robot
from evoros.simulator.protocol import Simulator
from evoros.walkers.walkers import WALKERS, Walkers
from evoros.world.course import A_COURSE, Course
from evoros.world.model import World
from evoros.worst_cases.worst_cases import A_SEARCH, WorstCases

AGENTS = mapping_of(Agent, "agents (evoros.evolution.agent.Agent)")
MEASURES = mapping_of(Measure, "measures (title, unit, bounds, direction, of_design and compute)")

CHAMPION, CHAMPIONS, ALL, NONE = "champion", "champions", "all", "none"
"""Whose trajectories a run keeps."""


@dataclass(frozen=True)
@checked
class Experiment:
    """Everything that determines a run.

    The fields are named like the keys and groups of ``conf/config.yaml``. ``confirmation`` repeats
    missions of the best designs in another simulator, or by another controller. ``agents`` are
    robots besides the first one, whose parts are fields of the experiment; ``walkers`` are moving
    obstacles. ``objectives`` and
    ``descriptors`` are measures that an optimizer may search by. ``figures`` names subcommands of
    evoros analyze, which draw the finished run. The worlds' courses may refer to the
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
    executor: Annotated[Executor, instance_of(Executor, "an executor (open)")]
    seed: Annotated[int, SEED] = 0
    trials: Annotated[int, COUNT] = 1  # missions of a design in each world
    draws: Annotated[str, one_of(*POLICIES)] = (
        "generation"  # within which missions share random draws
    )
    # Which designs of a generation get how many trials.
    allocation: Annotated[Allocation, AN_ALLOCATION] = field(default_factory=Once)
    lost_missions: Annotated[str, one_of(STOP, WORST)] = STOP  # if a mission crashes or hangs
    record: Annotated[str, one_of(CHAMPION, CHAMPIONS, ALL, NONE)] = CHAMPIONS  # trajectories
    confirmation: Annotated[Confirmation | None, A_CONFIRMATION] = None
    final_choice: Annotated[FinalChoice | None, A_FINAL_CHOICE] = None
    validation: Annotated[Validation, A_VALIDATION] = field(default_factory=Validation)
    agents: Annotated[Mapping[str, Agent], AGENTS] = field(default_factory=dict)
    walkers: Annotated[Mapping[str, Walkers], WALKERS] = field(default_factory=dict)
    objectives: Annotated[Mapping[str, Measure], MEASURES] = field(default_factory=dict)
    descriptors: Annotated[Mapping[str, Measure], MEASURES] = field(default_factory=dict)
    worst_cases: Annotated[WorstCases | None, A_SEARCH] = None  # which an evaluation looks for
    # What an evaluation requires of each design, whose trials end once all is decided.
    requirements: Annotated[Mapping[str, Requirement], REQUIREMENTS] = field(default_factory=dict)
    # Which draws an evaluation meets: fresh ones, or the draws of a run's validation.
    evaluation_draws: Annotated[str, one_of(EVALUATION, VALIDATION)] = EVALUATION
    figures: Sequence[str] = ()
    # Trackers that get what the run records.
    observers: Annotated[Mapping[str, Observer], OBSERVERS] = field(default_factory=dict)
    # The treatment in figures: its ``name``, and its levels by factor.
    treatment: Annotated[Mapping[str, Any], TREATMENT] = field(default_factory=dict)
    course: Annotated[Course | None, A_COURSE] = None

    def __post_init__(self) -> None:
        kinds = {"world": "world", "agents": "agent", "walkers": "group of walkers"}
        kinds |= {"objectives": "objective", "descriptors": "descriptor"}
        for group, kind in kinds.items():
            for name in getattr(self, group):
                if not NAME.holds(name):
                    rule = f"the key of each {kind} must be {NAME.text}"
                    raise InputError(f"{group}: {rule}, not {name!r}; rename it")
        if self.validation.precision is not None and self.combine is not mean:
            raise InputError(
                f"validation.precision: must be null, because it is of a mean, and the fitness "
                f"({type(self.fitness).__name__}) is another function of the trials; set "
                f"optimizer.validation_trials"
            )
        # Worlds that are drawn for each mission leave room to all robots.
        object.__setattr__(self, "world", make_room(self.members, self.world))
        check_team(self.members, self.world)
        worlds, agents = list(self.world), list(self.agents)
        check_requirements(self.requirements, worlds, agents, self.worst_cases)
        _ = self.confirming  # checks that the parts fit together

    @cached_property
    def members(self) -> tuple[Member, ...]:
        """The robots, with the controllers of the run; the top level's is first."""
        return self._list_members(self.controller)

    def _list_members(self, controller: Controller | LiveController) -> tuple[Member, ...]:
        """List the robots; those without a controller of their own have this one."""
        fails = PARTS[POSE] in list_parts(self.failure)
        first = Member(self.robot, self.design, controller, records_pose=fails)
        return (first, *(agent.join(name, first) for name, agent in self.agents.items()))

    @cached_property
    def scenario(self) -> Scenario:
        """The parts that missions need, with the run's own simulator."""
        return Scenario(self.members, self.world, self.failure, self.simulator, self.walkers)

    @cached_property
    def confirming(self) -> Scenario:
        """The parts with which missions are confirmed; ``scenario`` if there is no confirmation.

        Raises:
            InputError: the time step of that simulator does not fit the periods.
        """
        confirmation = self.confirmation
        if confirmation is None:
            return self.scenario
        members = self._list_members(confirmation.controller or self.controller)
        try:
            return replace(self.scenario, members=members, simulator=confirmation.simulator)
        except InputError as error:
            key = "confirmation" if confirmation.controller else "confirmation.simulator"
            raise InputError(f"{key}: {error}") from None

    def scenario_for(self, purpose: str) -> Scenario:
        """Return ``confirming`` for missions after the selection, and ``scenario`` otherwise.

        So validated, final and confirmed fitness are comparable.
        """
        confirming = purpose in (CONFIRMATION, VALIDATION, FINAL)
        return self.confirming if confirming else self.scenario

    @cached_property
    def space(self) -> TeamSpace:
        """The search space of all robots that have a design of their own."""
        owners = [member for member in self.members if member.has_own_design]
        return TeamSpace({member.name: member.space for member in owners})

    @cached_property
    def scoring(self) -> Scoring:
        """The fitness of all robots that are scored."""
        scored = (place for place, member in enumerate(self.members) if member.scored)
        return Scoring(self.fitness, tuple(scored))

    @property
    def states_cases(self) -> bool:
        """Whether missions meet stated cases of failures."""
        return self.worst_cases is not None or isinstance(self.failure, AdaptiveFailure)

    @property
    def fails_parts(self) -> bool:
        """Whether other parts of a robot than its sensors can fail."""
        return bool(list_parts(self.failure))

    @cached_property
    def combine(self) -> Combine:
        """Makes one fitness of the scores of a design's trials."""
        return self.scoring.combine

    def start_search(self) -> Search:
        """Start the search of this experiment, which its seed determines."""
        return self.optimizer.start(self.space, self.goals, generator(f"{self.seed}", "optimizer"))

    @cached_property
    def goals(self) -> Goals:
        """The measures that the scores of this experiment have besides the fitness."""
        bounds = {name: measure.bounds for name, measure in self.descriptors.items()}
        return Goals(
            tuple(self.objectives),
            {name: (float(low), float(high)) for name, (low, high) in bounds.items()},
        )

    @cached_property
    def plan(self) -> Plan:
        """The missions that score a design."""
        return Plan(
            self.seed,
            tuple(self.world),
            self.trials,
            self.optimizer.validation_trials,
            self.draws,
            self.allocation.most_trials(self.trials),
            self.validation.max_trials,
            self.evaluation_draws,
            self.validation.count_first(self.optimizer.validation_trials),
        )
