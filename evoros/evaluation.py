"""A design over its worlds and trials: expanded into missions, computed by a pool, scored."""

import math
import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import TypeVar

from evoros.errors import EvorosError, InputError, RunStopped, WorkerLost
from evoros.fitness import Fitness
from evoros.mission import Mission, Place, no_trajectory, not_flown, run_mission
from evoros.outcome import LOST, NOT_FLOWN, Outcome
from evoros.task import Task
from evoros.types import Array, Design, Pool

Result = TypeVar("Result")

SELECTION, CONFIRMATION = "selection", "confirmation"
VALIDATION, EVALUATION = "validation", "evaluation"
POLICIES = ("generation", "individual", "run")
STOP, WORST = "stop", "worst"
AHEAD = 4
"""Missions submitted for each worker ahead of time: enough that none waits, few to lose."""


@dataclass(frozen=True)
class Plan:
    """Which missions score a design, and the key of each one's draws."""

    seed: int
    worlds: tuple[str, ...]
    trials: int
    validation_trials: int
    policy: str  # who meets the same draws: a generation, an individual only, or the whole run

    def selection(self, generation: int, design_id: int, design: Design) -> list[Mission]:
        """The missions that give a design its fitness."""
        parts = {
            "generation": f"{generation}",
            "individual": f"{generation}:{design_id}",
            "run": "all",
        }
        return self._missions(
            generation, design_id, design, SELECTION, parts[self.policy], range(self.trials)
        )

    def validation(self, generation: int, design_id: int, design: Design) -> list[Mission]:
        """Missions under draws that never enter selection: the same ones for every design.

        Their trials are numbered after those of the selection.
        """
        trials = range(self.trials, self.trials + self.validation_trials)
        return self._missions(generation, design_id, design, VALIDATION, "all", trials)

    def confirmation(self, generation: int, design_id: int, design: Design) -> list[Mission]:
        """The missions of the selection again, under the same draws, for another simulator.

        Their trials are numbered after those of the validation.
        """
        after = self.trials + self.validation_trials
        return [
            replace(mission, trial=after + mission.trial, purpose=CONFIRMATION)
            for mission in self.selection(generation, design_id, design)
        ]

    def evaluation(self, generation: int, design_id: int, design: Design) -> list[Mission]:
        """Missions outside a run, under draws that no run is selected or validated on."""
        return self._missions(
            generation, design_id, design, EVALUATION, f"{generation}", range(self.trials)
        )

    def _missions(
        self,
        generation: int,
        design_id: int,
        design: Design,
        purpose: str,
        part: str,
        trials: range,
    ) -> list[Mission]:
        return [
            Mission(
                generation,
                design_id,
                design,
                world,
                trial,
                purpose,
                f"{self.seed}/{purpose}/{part}/{world}/{trial}",
            )
            for trial in trials
            for world in self.worlds
        ]


def fitness_of(
    fitness: Fitness, missions: Sequence[Mission], outcomes: Mapping[Place, Outcome]
) -> float:
    """Mean over the trials of the score over the worlds.

    Raises:
        InputError: a score is not a finite number.
    """
    scores = trial_scores(fitness, missions, outcomes)
    return sum(scores) / len(scores)


def trial_scores(
    fitness: Fitness, missions: Sequence[Mission], outcomes: Mapping[Place, Outcome]
) -> list[float]:
    """The score of each trial over the worlds, in the order of the missions.

    A trial of which a mission could not be flown counts as the worst, whatever the others did.

    Raises:
        InputError: a score is not a finite number.
    """
    by_trial: dict[int, list[Outcome]] = {}
    for mission in missions:
        by_trial.setdefault(mission.trial, []).append(outcomes[mission.place])
    scores = [float(_score(fitness, trial)) for trial in by_trial.values()]
    if not all(map(math.isfinite, scores)):
        raise InputError(
            f"fitness: must score every trial with a finite number, not {scores}; correct "
            f"{type(fitness).__name__}"
        )
    return scores


def _score(fitness: Fitness, trial: Sequence[Outcome]) -> float:
    flown = all(outcome.ended not in NOT_FLOWN for outcome in trial)
    return fitness.score(trial) if flown else fitness.worst(trial)


def compute(
    task: Task, missions: Sequence[Mission], pool: Pool, workers: int, lost: str
) -> Iterator[tuple[Mission, Outcome]]:
    """The outcomes of the missions, as they come; at most a few are submitted ahead.

    Raises:
        RunStopped: a mission crashed or hung in spite of its retries, and ``lost`` is ``stop``.
    """
    blob = _packed(task)
    waiting = list(reversed(missions))
    running: dict[Future[Outcome], Mission] = {}
    try:
        while waiting or running:
            while waiting and len(running) < workers * AHEAD:
                mission = waiting.pop()
                running[pool.submit(_outcome, blob, mission)] = mission
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                mission = running.pop(future)
                worst = partial(not_flown, task, mission, LOST)
                yield mission, _settled(mission, future, lost, worst)
    finally:
        for future in running:
            future.cancel()


def trajectories(task: Task, missions: Sequence[Mission], pool: Pool, lost: str) -> list[Array]:
    """The trajectories of the missions, in order; without rows where one could not be flown.

    Raises:
        RunStopped: as in ``compute``.
    """
    blob = _packed(task)
    futures = [pool.submit(_trajectory, blob, mission) for mission in missions]
    return [
        _settled(mission, future, lost, partial(_nowhere, mission))
        for mission, future in zip(missions, futures, strict=True)
    ]


def _nowhere(mission: Mission, reason: str) -> Array:
    return no_trajectory(mission)


def _packed(task: Task) -> bytes:
    """The task for the workers, packed once for all missions.

    Raises:
        InputError: a part does not pickle.
    """
    try:
        return pickle.dumps(task)
    except Exception as error:  # whatever a user's class raises
        raise InputError(
            f"the experiment cannot be sent to worker processes ({error}); define every class at "
            f"the top of a module, and keep open files and the like out of descriptions"
        ) from error


def _settled(
    mission: Mission, future: "Future[Result]", lost: str, worst: Callable[[str], Result]
) -> Result:
    """What the mission gave; ``worst`` of the reason where it was lost and that is no stop."""
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, EvorosError) and not isinstance(error, WorkerLost):
        raise error
    reason = str(error) if isinstance(error, WorkerLost) else f"{type(error).__name__}: {error}"
    if lost == STOP or not isinstance(error, Exception):
        raise RunStopped(f"{describe(mission)}: {reason}") from error
    return worst(reason)


def describe(mission: Mission) -> str:
    """For messages: which mission."""
    return (
        f"the mission of design {mission.design_id} in {mission.world}, "
        f"generation {mission.generation}, trial {mission.trial}"
    )


def _outcome(blob: bytes, mission: Mission) -> Outcome:
    return run_mission(_task(blob), mission)[0]


def _trajectory(blob: bytes, mission: Mission) -> Array:
    return run_mission(_task(blob), mission)[1]


@lru_cache(maxsize=2)
def _task(blob: bytes) -> Task:
    """Unpickled once in each worker process."""
    task: Task = pickle.loads(blob)
    return task
