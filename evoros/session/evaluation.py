"""The evaluation of given designs: their outcomes, scores and verdicts."""

from collections.abc import Iterator, Mapping, Sequence
from statistics import fmean
from typing import Any

from evoros.base.checks import TEXT
from evoros.base.errors import InputError, write_count
from evoros.config.configuration import Configuration
from evoros.dispatch.dispatcher import Dispatcher, MissionResult
from evoros.evolution.experiment import ALL, Experiment
from evoros.executor.protocol import Pool
from evoros.fitness.scoring import FITNESS, FITNESS_MEAN
from evoros.mission.mission import Mission, Outcomes
from evoros.mission.plan import TRIALS, VALIDATION, VALIDATION_TRIALS
from evoros.mission.scenario import Scenario
from evoros.observers.protocol import FREE
from evoros.preflight.preflight import preflight
from evoros.preflight.sight import check_designs
from evoros.requirement.claim import OWN, Condition
from evoros.requirement.requirements import Judged, need_conditions
from evoros.session.design_tables import NamedDesign
from evoros.session.design_trials import DesignTrials
from evoros.session.given_designs import read_given, warn_of_changes
from evoros.session.status import Status
from evoros.session.worst_case_run import WorstCaseRun, keep_worst
from evoros.storage.layout import SCORES
from evoros.storage.run_folder import RunFolder
from evoros.storage.tables import to_csv
from evoros.storage.verdicts import write_verdicts
from evoros.terminal.activity import tell_slow
from evoros.terminal.log import LOGGER


def build_evaluation(config: Configuration) -> tuple[Experiment, list[NamedDesign]]:
    """Build and check the experiment and the given designs of an evaluation."""
    _check_sources(config.designs)
    for key in FREE[1:]:
        if any(text.lstrip("+~").startswith(key) for text in config.overrides):
            raise InputError(f"{key}: must not be given for an evaluation; leave it out")
    with tell_slow("reading the robot and the worlds"):
        experiment = config.build()
    _check_draws(experiment)
    preflight(experiment)
    warn_of_changes(config, experiment)
    designs = read_sources(config.designs, experiment)
    _check_levels(designs, experiment)
    return experiment, designs


def read_sources(sources: Any, experiment: Experiment) -> list[NamedDesign]:
    """Read the designs that the key ``designs`` names."""
    return read_given(_check_sources(sources), experiment)


def _check_sources(designs: Any) -> list[str]:
    sources = designs if isinstance(designs, list) else [designs]
    if not sources or not all(TEXT.holds(source) for source in sources):
        raise InputError(
            f"designs: must be a CSV file, the folder of a finished run or of a sweep, or a list "
            f"of these, not {'null' if designs is None else designs}; add designs=FILE.csv"
        )
    return sources


def _check_draws(experiment: Experiment) -> None:
    if experiment.evaluation_draws != VALIDATION:
        return
    if not experiment.plan.evaluation_trials:
        raise InputError(
            "validation.trials: with evaluation_draws=validation, must be at least 1, not 0; "
            "type validation.trials=5, for example"
        )
    asked = {"worst_cases": experiment.worst_cases is not None}
    for name, requirement in experiment.requirements.items():
        asked[f"requirements.{name}"] = need_conditions(requirement)
    for key in (key for key, has_draws in asked.items() if has_draws):
        raise InputError(
            f"{key}: cannot be combined with evaluation_draws=validation, because the two use "
            "different draws; leave out one of them"
        )


def _check_levels(designs: Sequence[NamedDesign], experiment: Experiment) -> None:
    """Check that designs have enough sensors for all requirements; warn about too few trials."""
    for index, named in enumerate(designs):
        try:
            DesignTrials(experiment, index, named.design)
        except InputError as error:
            raise InputError(f"design {named.name} of {named.source}: {error}") from None
    trials = experiment.plan.evaluation_trials
    validation = experiment.evaluation_draws == VALIDATION
    for name, requirement in experiment.requirements.items():
        needed = requirement.fewest_trials
        if trials < needed:
            LOGGER.warning(
                "requirements.%s: cannot be met with %d trials; type %s=%d or more",
                *(name, trials, VALIDATION_TRIALS if validation else TRIALS, needed),
            )


def list_faults(designs: Sequence[NamedDesign], scenario: Scenario) -> Iterator[str]:
    """Yield warnings about sensors that overlap or that have the robot in view."""
    robots = {
        f"{member.name}: design {named.name} of {named.source}".removeprefix(": "): member.robot
        for named in designs
        for member in scenario.equip(named.design)
    }
    yield from check_designs(robots)


class Evaluation:
    """The evaluation of designs, each identified by its index."""

    def __init__(
        self, experiment: Experiment, folder: RunFolder, designs: Sequence[NamedDesign]
    ) -> None:
        self.experiment, self.folder, self.designs = experiment, folder, designs
        self._trials = [
            DesignTrials(experiment, index, named.design) for index, named in enumerate(designs)
        ]
        self._scores: dict[int, dict[str, float]] = {}  # one entry per finished design
        self._judged: dict[int, Mapping[str, Judged]] = {}  # one entry per finished design

    @property
    def amount(self) -> str:
        """The size of the evaluation, for the log."""
        trials = write_count(self.experiment.plan.evaluation_trials, "trial")
        return f"{write_count(len(self.designs), 'design')}, {trials}"

    @property
    def _wanted(self) -> int:
        return sum(trials.wanted for trials in self._trials)

    @property
    def _known(self) -> int:
        return sum(trials.known for trials in self._trials)

    def describe(self) -> dict[str, Any]:
        """Return the fields of ``status.json`` that are specific to evaluations."""
        fitness = [row.get(FITNESS, row[FITNESS_MEAN]) for row in self._scores.values()]
        return {
            "designs": len(self.designs),
            "designs_done": len(self._scores),
            "trials": self.experiment.plan.evaluation_trials,
            "best_fitness": max(fitness, default=None),
            "mean_fitness": fmean(fitness) if fitness else None,
            "missions_wanted": self._wanted + max(0, len(self.folder.rows) - self._known),
        }

    def list_first(self) -> Iterator[tuple[Scenario, Mission]]:
        """Yield the first mission."""
        scenario, missions = next(self._list_missions())
        yield scenario, next(missions)

    def run(self, pool: Pool, status: Status) -> None:
        """Run all missions without outcomes; write the scores and the verdicts."""
        experiment, folder = self.experiment, self.folder
        for trials in self._trials:
            self._read(trials)
        self._show(status)
        keep = folder.keep_trajectory if experiment.record == ALL else None
        dispatcher = Dispatcher(pool, experiment.lost_missions, folder.keep_log, keep)
        while self._known < self._wanted:  # undecided requirements need more missions
            for scenario, missions in self._list_missions():
                dispatcher.run_missing(scenario, missions, self, status.mission)
            self._show(status)
        self._search_worst_cases(dispatcher, status)
        self._write_results()
        keep_worst(folder, experiment, self.designs, dispatcher)
        folder.complete()

    def _show(self, status: Status) -> None:
        status.display.begin(0, sum(trials.most for trials in self._trials), self._known)

    def _read(self, trials: DesignTrials) -> None:
        while not trials.finished:
            new = [one for one in trials.list_all() if one.key not in trials.outcomes]
            found = [mission for mission in new if self.folder.has(mission)]
            for mission in found:
                outcomes = self.folder.find(mission)
                assert outcomes is not None, "the folder has the mission"
                self._take(mission, outcomes)
            if not found:
                return

    def _list_missions(self) -> Iterator[tuple[Scenario, Iterator[Mission]]]:
        conditions: dict[Scenario, dict[Condition, None]] = {}
        for trials in self._trials:
            for condition in trials.conditions:
                scenario = self.experiment.scenario_under(condition)
                conditions.setdefault(scenario, {})[condition] = None
        for scenario, of_scenario in conditions.items():
            yield scenario, self._list_under(list(of_scenario))

    def _list_under(self, conditions: Sequence[Condition]) -> Iterator[Mission]:
        for trials in self._trials:
            for condition in conditions:
                if not trials.finished:
                    yield from trials.list_wanted(condition)

    def has(self, mission: Mission) -> bool:
        """Return True if the outcome of a planned mission is known."""
        trials = self._trials[mission.design_id]
        return trials.finished or mission.key in trials.outcomes

    def record(self, results: Sequence[MissionResult]) -> None:
        """Record finished missions, and score each design that they complete."""
        self.folder.record(results)
        for result in results:
            self._take(*result)

    def _take(self, mission: Mission, outcomes: Outcomes) -> None:
        index = mission.design_id
        trials = self._trials[index]
        trials.take(mission.key, outcomes)
        if trials.finished:
            own = trials.list_wanted(OWN)
            self._scores[index] = self.experiment.scoring.summarize(own, trials.outcomes)
            self._judged[index] = trials.judge()
            trials.forget()

    def _search_worst_cases(self, dispatcher: Dispatcher, status: Status) -> None:
        experiment, settings = self.experiment, self.experiment.worst_cases
        if settings is None:
            return
        rates = [
            {world: self._scores[index][f"{world}_completed"] for world in experiment.world}
            for index in range(len(self.designs))
        ]
        conditions = [len(trials.conditions) for trials in self._trials]
        about = (experiment, settings, self.designs, rates, conditions)
        WorstCaseRun(*about, self.folder, dispatcher, status).run()

    def _write_results(self) -> None:
        self.folder.table.sync()
        columns = self.experiment.scoring.name_columns(list(self.experiment.world))
        names = [(named.source, named.name) for named in self.designs]
        scores = [(*name, *self._scores[index].values()) for index, name in enumerate(names)]
        self.folder.write_once(SCORES, to_csv([("source", "design", *columns), *scores]))
        requirements = self.experiment.requirements
        if requirements:
            judged = {name: self._judged[index] for index, name in enumerate(names)}
            for file, content in write_verdicts(requirements, judged).items():
                self.folder.write_once(file, content)
