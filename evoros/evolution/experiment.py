"""The description of a run by its parts, with checks that the parts fit together."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any

from evoros.allocation.once import Once
from evoros.allocation.protocol import Allocation
from evoros.base.checks import (
    COUNT,
    NAME,
    SEED,
    Rule,
    ask,
    checked,
    instance_of,
    mapping_of,
    one_of,
)
from evoros.base.combining import mean
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.certificate.confirmation import A_CONFIRMATION, Confirmation
from evoros.certificate.controls import SOME_CONTROLS, Controls
from evoros.certificate.final_choice import A_FINAL_CHOICE, AN_ALLOCATION, FinalChoice
from evoros.certificate.validation import A_VALIDATION, Validation, check_precision
from evoros.controller.protocol import Controller, LiveController
from evoros.design.space import SensorDesign
from evoros.design.team import TeamSpace
from evoros.evolution.agent import Agent, check_team, make_room
from evoros.evolution.stop_after import A_LIMIT, StopAfter
from evoros.evolution.treatment import TREATMENT
from evoros.executor.protocol import Executor
from evoros.failure.given import GivenFailure
from evoros.failure.protocol import PARTS, AdaptiveFailure, Case, Failure, SystematicFailure
from evoros.filter.protocol import POSE
from evoros.filter.silence import Silence
from evoros.fitness.naming import bound_fitness
from evoros.fitness.protocol import AdditiveFitness, Fitness
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
from evoros.optimizer.protocol import AskedSearch, Goals, Optimizer, Search
from evoros.requirement.claim import Condition
from evoros.requirement.requirements import (
    REQUIREMENTS,
    Requirement,
    check_requirements,
    list_conditions,
    need_conditions,
)
from evoros.robot.model import Robot
from evoros.simulator.protocol import Simulator
from evoros.walkers.crowd import WALKERS, Walkers
from evoros.world.course import A_COURSE, Course
from evoros.world.model import World
from evoros.worst_cases.worst_cases import A_SEARCH, WorstCases

AGENTS = mapping_of(Agent, "agents (evoros.evolution.agent.Agent)")
MEASURES = mapping_of(Measure, "measures (title, unit, bounds, direction, of_design and compute)")

CHAMPION, CHAMPIONS, ALL, NONE = "champion", "champions", "all", "none"  # values of ``record``
A_SEARCHER = Rule("a search (an object with ask, tell and champions)", lambda v: hasattr(v, "ask"))
STATED = Condition(Case())  # represents every given case, because all cases share one scenario


def check_case(group: str, names: Iterable[str]) -> None:
    """Check that names differ in more than upper and lower case, which file systems may ignore."""
    known: dict[str, str] = {}
    for name in names:
        other = known.setdefault(name.casefold(), name)
        if other != name:
            raise InputError(
                f"{group}: {other} and {name} differ only in upper and lower case, which some file "
                "systems ignore; rename one"
            )


@dataclass(frozen=True)
@checked
class Experiment:
    """Everything that determines a run.

    The fields are named after the keys and groups in ``conf/config.yaml``. ``confirmation`` repeats
    the missions of the best designs in another simulator or with another controller. ``agents`` are
    robots in addition to the first robot, which the other fields describe; ``walkers`` are moving
    obstacles. ``objectives`` and ``descriptors`` are measures for the optimizer. ``figures`` names
    the subcommands of evoros analyze that draw the finished run. Courses of worlds may refer to
    values in ``course``.
    """

    robot: Robot
    world: Mapping[str, World]
    design: SensorDesign
    failure: Failure
    controller: Controller | LiveController
    simulator: Simulator
    fitness: Annotated[
        Fitness, instance_of(Fitness, "a fitness function (a subclass of evoros.parts.Fitness)")
    ]
    optimizer: Annotated[
        Optimizer, instance_of(Optimizer, "an optimizer (a subclass of evoros.parts.Optimizer)")
    ]
    executor: Annotated[
        Executor, instance_of(Executor, "an executor (a subclass of evoros.parts.Executor)")
    ]
    seed: Annotated[int, SEED] = 0
    trials: Annotated[int, COUNT] = 1  # number of missions per design and world
    draws: Annotated[str, one_of(*POLICIES)] = "generation"  # scope of shared random draws
    # distribution of trials among the designs of a generation
    allocation: Annotated[Allocation, AN_ALLOCATION] = field(default_factory=Once)
    lost_missions: Annotated[str, one_of(STOP, WORST)] = STOP  # reaction to crashes and hangs
    # trajectories to keep
    record: Annotated[str, one_of(CHAMPION, CHAMPIONS, ALL, NONE)] = CHAMPIONS
    confirmation: Annotated[Confirmation | None, A_CONFIRMATION] = None
    final_choice: Annotated[FinalChoice | None, A_FINAL_CHOICE] = None
    validation: Annotated[Validation, A_VALIDATION] = field(default_factory=Validation)
    agents: Annotated[Mapping[str, Agent], AGENTS] = field(default_factory=dict)
    walkers: Annotated[Mapping[str, Walkers], WALKERS] = field(default_factory=dict)
    objectives: Annotated[Mapping[str, Measure], MEASURES] = field(default_factory=dict)
    descriptors: Annotated[Mapping[str, Measure], MEASURES] = field(default_factory=dict)
    worst_cases: Annotated[WorstCases | None, A_SEARCH] = None  # search for worst cases
    # Requirements for each design in an evaluation, which ends once they are decided.
    requirements: Annotated[Mapping[str, Requirement], REQUIREMENTS] = field(default_factory=dict)
    # Random draws of an evaluation: fresh ones, or the draws of a run's validation.
    evaluation_draws: Annotated[str, one_of(EVALUATION, VALIDATION)] = EVALUATION
    controls: Annotated[Controls | None, SOME_CONTROLS] = None  # compared with the champion
    stop_after: Annotated[StopAfter, A_LIMIT] = field(default_factory=StopAfter)
    figures: Sequence[str] = ()
    # Trackers that receive the records of the run.
    observers: Annotated[Mapping[str, Observer], OBSERVERS] = field(default_factory=dict)
    # The treatment in figures: its ``name``, and its level of each factor.
    treatment: Annotated[Mapping[str, Any], TREATMENT] = field(default_factory=dict)
    course: Annotated[Course | None, A_COURSE] = None

    def __post_init__(self) -> None:
        kinds = {"world": "world", "agents": "agent", "walkers": "group of walkers"}
        kinds |= {"objectives": "objective", "descriptors": "descriptor"}
        for group, kind in kinds.items():
            for name in getattr(self, group):
                if not NAME.holds(name):
                    rule = f"the key of each {kind} must be {NAME.text}"
                    raise InputError(f"{group}: {rule}, not {name!r}")
            check_case(group, getattr(self, group))
        if self.validation.precision is not None and self.scoring.combine is not mean:
            raise InputError(
                "validation.precision: must be null, because precision applies only to a fitness "
                f"function that averages trials, not to {type(self.fitness).__name__}; set "
                "optimizer.validation_trials"
            )
        check_precision(self.validation, self.scored_missions, self.fitness_bounds)
        other = self.confirmation.controller if self.confirmation else None
        for member in (*self.members, *(self._list_members(other) if other else ())):
            member.check_parts()
        # Worlds drawn for each mission must leave room for all robots.
        object.__setattr__(self, "world", make_room(self.members, self.world))
        check_team(self.members, self.world)
        worlds, agents = list(self.world), list(self.agents)
        check_requirements(self.requirements, worlds, agents)
        self.scenario_for(CONFIRMATION)  # checks that the parts are compatible
        for condition in self.conditions.values():
            self.scenario_under(condition)

    @cached_property
    def members(self) -> tuple[Member, ...]:
        """The robots with the controllers of the run, the main robot first."""
        return self._list_members(self.controller)

    def _list_members(self, controller: Controller | LiveController) -> tuple[Member, ...]:
        fails = PARTS[POSE] in self.failure.parts
        first = Member(self.robot, self.design, controller, records_pose=fails)
        return (first, *(agent.join(name, first) for name, agent in self.agents.items()))

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario for missions in the run's simulator."""
        return Scenario(self.members, self.world, self.failure, self.simulator, self.walkers)

    @cached_property
    def confirming(self) -> Scenario:
        """The scenario for confirming missions; ``scenario`` if the run has no confirmation."""
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
        """Return ``confirming`` for confirming and later missions, otherwise ``scenario``."""
        confirming = purpose in (CONFIRMATION, VALIDATION, FINAL)
        return self.confirming if confirming else self.scenario

    @cached_property
    def _scenarios(self) -> dict[Condition, Scenario]:
        return {}

    def scenario_under(self, condition: Condition) -> Scenario:
        """Return the scenario for an evaluation's missions under a condition."""
        key = condition if condition.case is None else STATED
        if key not in self._scenarios:
            self._scenarios[key] = self._make_scenario(key)
        return self._scenarios[key]

    def _make_scenario(self, condition: Condition) -> Scenario:
        if condition.case is not None:
            effect = None if self.failure.parts else self.failure.effect
            return replace(self.scenario, failure=GivenFailure(effect=effect or Silence()))
        if not condition.factor:
            return self.scenario_for(self.evaluation_draws)
        changed: Any = {condition.factor: condition.part, "requirements": {}}
        try:
            if isinstance(condition.part, SystematicFailure):
                raise InputError(
                    f"must be drawn for each mission, unlike {type(condition.part).__name__}; "
                    f"choose another failure model, for example random"
                )
            return replace(self, **changed).scenario
        except InputError as error:
            raise InputError(f"requirements, each {condition.text}: {error}") from None

    @property
    def conditions(self) -> dict[str, Condition]:
        """The conditions in requirements that replace parts of the experiment, by ``text``."""
        return list_conditions(self.requirements)

    @cached_property
    def space(self) -> TeamSpace:
        """The search space of all robots with separate designs."""
        owners = [member for member in self.members if member.has_own_design]
        return TeamSpace({member.name: member.space for member in owners})

    @cached_property
    def scoring(self) -> Scoring:
        """The scoring of all robots included in the fitness."""
        scored = (place for place, member in enumerate(self.members) if member.scored)
        return Scoring(self.fitness, tuple(scored))

    @property
    def scored_missions(self) -> int:
        """The number of scores per trial: one per mission for an additive fitness, else one."""
        return len(self.world) if isinstance(self.fitness, AdditiveFitness) else 1

    @property
    def fitness_bounds(self) -> tuple[float, ...]:
        """The minimum and maximum of the fitness; empty if unknown."""
        return bound_fitness(self.fitness, len(self.world))

    @property
    def states_cases(self) -> bool:
        """True if missions may use stated failure cases or other conditions."""
        required = any(map(need_conditions, self.requirements.values()))
        stating = isinstance(self.failure, SystematicFailure | AdaptiveFailure)
        return required or stating or self.worst_cases is not None

    def start_search(self) -> Search:
        """Start the search of the experiment, with random draws determined by the seed."""
        rng = generator(f"{self.seed}", "optimizer")
        search = ask("optimizer", self.optimizer.start, A_SEARCHER, self.space, self.goals, rng)
        return AskedSearch(search, self.space.size)

    @cached_property
    def goals(self) -> Goals:
        """The measures that scores contain in addition to the fitness."""
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
            max(self.optimizer.validation_trials, self.validation.trials or 0),
            self.failure if isinstance(self.failure, SystematicFailure) else None,
        )
