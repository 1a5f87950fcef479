"""The search of a run, which evolves designs and updates the status, log and observers."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from evoros.base.errors import InputError, write_count
from evoros.certificate.certificate import Certificate
from evoros.certificate.validation import foresee_trials
from evoros.config.configuration import Configuration
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Generation, Watcher
from evoros.evolution.loop import evolve
from evoros.evolution.stop_after import Spent
from evoros.executor.protocol import Pool
from evoros.mission.mission import Mission, Outcomes
from evoros.mission.plan import EVALUATION
from evoros.mission.scenario import Scenario
from evoros.preflight.preflight import preflight
from evoros.session.given_designs import check_controls
from evoros.session.observation import Tell, ignore
from evoros.session.status import Status
from evoros.storage.layout import FINISHED, RUNNING
from evoros.storage.run_folder import RunFolder
from evoros.terminal.activity import tell_slow
from evoros.terminal.log import LOGGER, log_progress

UNUSED: dict[str, object] = {  # keys that only evaluations use, with their values in a search
    "requirements": {},
    "worst_cases": None,
    "evaluation_draws": EVALUATION,
}


def build_search(config: Configuration) -> Experiment:
    """Build and check the experiment of a search."""
    with tell_slow("reading the robot and the worlds"):
        experiment = config.build()
    for observer in experiment.observers.values():
        observer.check()
    for key, unset in UNUSED.items():
        if getattr(experiment, key) != unset:
            raise InputError(
                f"{key}: cannot be used in a run; use it with the run's champion: "
                f"evoros evaluate like=FOLDER {key}=..."
            )
    preflight(experiment)
    check_controls(experiment)
    return experiment


@dataclass
class Search(Watcher):
    """A search that records its own progress as a watcher of the evolution."""

    experiment: Experiment
    folder: RunFolder
    generations: int
    extended: bool = False  # whether the search may already have ended at a different generation
    stays: bool = False  # whether to leave a search as it is if a limit ended it
    last: Generation | None = None
    certificate: Certificate | None = None  # None until the search ends
    reason: str = ""  # the limits that ended the search; empty if none did
    processor_s: list[float] = field(init=False)  # cumulative [s], one entry per generation
    tell: Tell = ignore  # tells observers the number of recorded generations

    def __post_init__(self) -> None:
        status = self.folder.read_status()
        self.processor_s = list(status.get("processor_s", ()))
        self._before = max(self.processor_s, default=0.0)
        ended = self.stays and status.get("state") == FINISHED and bool(status.get("reason"))
        self._ended = (status["generations_done"], status["reason"]) if ended else (0, "")

    @property
    def amount(self) -> str:
        """The size of the search, for the log."""
        return write_count(self.generations, "generation")

    def describe(self) -> dict[str, Any]:
        """Return the fields of ``status.json`` that are specific to searches."""
        last, certificate = self.last, self.certificate
        fields = {
            "generations": self.generations,
            "generations_done": 0 if last is None else last.number + 1,
            "processor_s": self.processor_s,
            "best_fitness": None if last is None else last.best.fitness,
            "best_validated_fitness": None if last is None else last.validated,
            **dict.fromkeys(("validated_trials", "fitness_low", "fitness_high")),
            "rival_advantage": None,
            "best_loss": None if last is None else last.loss,
            "mean_loss": None if last is None else last.mean_loss,
            "confirmed": 0 if last is None else len(last.losses),
        }
        return fields if certificate is None else {**fields, **certificate.summary}

    def list_first(self) -> Iterator[tuple[Scenario, Mission]]:
        """Yield the first mission and, if another controller confirms designs, its first."""
        experiment = self.experiment
        individual = experiment.start_search().ask()[0]
        design = experiment.space.decode(individual.genome)
        plan, confirmation = experiment.plan, experiment.confirmation
        yield experiment.scenario, plan.selection(0, individual.id, design)[0]
        if confirmation is not None and confirmation.controller is not None:
            yield experiment.confirming, plan.confirmation(0, individual.id, design)[0]

    def run(self, pool: Pool, status: Status) -> None:
        """Complete the search, as in ``Session.run``."""
        self._status, experiment = status, self.experiment
        missions, bounds = experiment.scored_missions, experiment.fitness_bounds
        if foreseen := foresee_trials(experiment.validation, missions, bounds):
            LOGGER.info(foreseen)
        self._recorded = self.folder.count_generations()
        ending = evolve(experiment, self.folder, self, self.generations, pool, self._stops)
        self.certificate = ending.certificate
        self.folder.complete(ending.last.number + 1, self.extended)

    def _stops(self, spent: Spent) -> bool:
        """Record a generation's cost; return True if a limit ends the search here."""
        spent.wall_s = self._status.wall_s
        if len(self.processor_s) == spent.generations - 1 >= self._recorded:
            self.processor_s.append(round(self._before + spent.processor_s, 3))
        if spent.generations == self._ended[0]:
            self.reason = self._ended[1]
        elif self._recorded <= spent.generations < self.generations:
            self.reason = self.experiment.stop_after.find_reached(spent)
        return bool(self.reason)

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Show the number of missions in a generation."""
        self._status.display.begin(generation, missions, known)

    def mission(self, mission: Mission, outcomes: Outcomes) -> None:
        """Count a mission, and show the progress."""
        self._status.mission(mission, outcomes)

    def generation(self, generation: Generation) -> None:
        """Record a generation in the status and the log, and show it."""
        self.last = generation
        self._status.write(RUNNING)
        log_progress(
            "generation %d/%d: %s", generation.number, self.generations - 1, generation.summary
        )
        if self.reason:
            LOGGER.info("stopped: %s", self.reason)
        self._status.display.generation(generation)
        self.tell(generation.number + 1)
