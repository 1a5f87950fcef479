"""The end of a run: which design is the champion, and what fresh draws say of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from evoros.certificate.certificate import Certificate, Finalist, Rate, Rival
from evoros.certificate.validation import Validation, combine_chances, compute_chance
from evoros.evolution.contest import Contest
from evoros.evolution.journal import Generation
from evoros.evolution.scores import Scores
from evoros.evolution.validated import Validated
from evoros.mission.outcome import Outcome
from evoros.mission.plan import FINAL
from evoros.optimizer.protocol import Individual


@dataclass(frozen=True)
class Choice:
    """The champion, the fitness by which it was chosen, and the others, the best first."""

    individual: Individual
    fitness: float
    trials: int
    others: list[Individual]
    finalists: list[Finalist]


def choose_champion(scores: Scores, last: Generation) -> Choice:
    """Return the last generation's best, or the one that the final choice finds.

    Raises:
        InputError, RunStopped: see ``Trials.score``.
    """
    experiment = scores.trials.experiment
    final, combine = experiment.final_choice, experiment.combine
    if final is None:
        best = last.best.individual
        by_fitness = sorted(last.candidates, key=lambda each: -each.fitness)
        alive = {row.individual.id: row.individual for row in by_fitness if row.survived}
        alive.pop(best.id, None)
        return Choice(best, last.best.fitness, last.trials[best.id], list(alive.values()), [])
    individuals = scores.ledger.finalists
    fitness = scores.ledger.find_fitness(individuals)
    finalists = final.find_finalists(fitness)
    designs = scores.trials.decode([individuals[number] for number in finalists])
    contest = Contest(final.method, 1, {number: [] for number in finalists}, combine)
    while wanted := contest.next_round():
        missions = {
            number: experiment.plan.final(last.number, number, designs[number], trials)
            for number, trials in wanted.items()
        }
        contest.add(scores.trials.score(last.number, missions, FINAL))
    final_fitness, stayed = contest.fitness(), contest.stays()
    order = sorted(finalists, key=lambda number: (-stayed[number], -final_fitness[number]))
    table = [
        Finalist(number, fitness[number], len(own), combine(own))
        for number in order
        for own in [contest.scores[number]]
    ]
    ranked = [individuals[number] for number in order]
    return Choice(ranked[0], table[0].final_fitness, table[0].trials, ranked[1:], table)


def certify(validated: Validated, last: Generation, choice: Choice) -> Certificate:
    """Validate the champion as precisely as the experiment asks, and compare it with its rivals.

    Rivals are all designs that have been validated, on the same draws.

    Raises:
        InputError, RunStopped: see ``Trials.score``.
    """
    experiment = validated.trials.experiment
    validation, combine = experiment.validation, experiment.combine
    champion, leaders = choice.individual, set(validated.scores)
    for individual in [champion, *choice.others[: validation.rivals]]:
        validated.validate(last.number, individual)
    stage = validation.count_first(len(validated.scores[champion.id]))
    first, _ = validated.extend(champion, stage)
    trials = validation.count_all(first) if first else 0
    scores, outcomes = validated.extend(champion, trials)
    low, high = validation.bound_fitness(scores, len(first), combine)
    rivals = [
        Rival(number, len(met), combine(met), chance, number in leaders)
        for number, met in validated.scores.items()
        if number != champion.id and met
        for chance in [compute_chance(scores, met, combine)]
    ]
    return Certificate(
        design=champion.id,
        recorded_fitness=choice.fitness,
        recorded_trials=choice.trials,
        validated_fitness=combine(scores) if scores else math.nan,
        validated_trials=len(scores),
        confidence=validation.confidence,
        fitness_low=low,
        fitness_high=high,
        precision=validation.precision,
        worlds={world: _rate(validation, outcomes.get(world, [])) for world in experiment.world},
        rivals=rivals,
        chance_of_better=combine_chances([rival.chance for rival in rivals]),
        finalists=choice.finalists,
    )


def _rate(validation: Validation, outcomes: Sequence[Outcome]) -> Rate:
    completed = sum(outcome.completed for outcome in outcomes)
    return Rate(completed, len(outcomes), *validation.bound_rate(completed, len(outcomes)))
