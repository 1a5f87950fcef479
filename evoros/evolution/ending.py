"""The end of a run: which design is the champion, and what fresh draws say of it."""

import math
from dataclasses import dataclass

from evoros.evolution.certificate import Certificate, Finalist, Rate, Rival
from evoros.evolution.contest import Contest
from evoros.evolution.journal import Generation
from evoros.evolution.scores import Scores
from evoros.evolution.validation import combine_chances, compute_chance
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
        InputError, RunStopped: see ``Scores.evaluate``.
    """
    final = scores.experiment.final_choice
    if final is None:
        best = last.best.individual
        by_fitness = sorted(last.candidates, key=lambda each: -each.fitness)
        alive = {row.individual.id: row.individual for row in by_fitness if row.survived}
        alive.pop(best.id, None)
        return Choice(best, last.best.fitness, last.trials[best.id], list(alive.values()), [])
    individuals = scores.ledger.finalists
    fitness = scores.ledger.find_fitness(individuals)
    finalists = final.find_finalists(fitness)
    designs = scores.decode([individuals[number] for number in finalists])
    contest = Contest(final.method, 1, {number: [] for number in finalists}, scores.combine)
    while wanted := contest.next_round():
        missions = {
            number: scores.experiment.plan.final(last.number, number, designs[number], trials)
            for number, trials in wanted.items()
        }
        contest.add(scores.score(last.number, missions, FINAL))
    final_fitness, stayed = contest.fitness(), contest.stays()
    order = sorted(finalists, key=lambda number: (-stayed[number], -final_fitness[number]))
    table = [
        Finalist(number, fitness[number], len(own), scores.combine(own))
        for number in order
        for own in [contest.scores[number]]
    ]
    ranked = [individuals[number] for number in order]
    return Choice(ranked[0], table[0].final_fitness, table[0].trials, ranked[1:], table)


def certify(scores: Scores, last: Generation, choice: Choice) -> Certificate:
    """Validate the champion as precisely as the experiment asks, and compare it with its rivals.

    Rivals are all designs that have been validated, on the same draws.

    Raises:
        InputError, RunStopped: see ``Scores.evaluate``.
    """
    validation = scores.experiment.validation
    own = choice.individual
    leaders = set(scores.validated)
    for individual in [own, *choice.others[: validation.rivals]]:
        scores.validate(last.number, individual)
    stage = validation.count_first(len(scores.validated[own.id]))
    first, _ = scores.validate_longer(own, stage)
    trials = validation.count_all(first) if first else 0
    found, outcomes = scores.validate_longer(own, trials)
    low, high = validation.bound_fitness(found, len(first), scores.combine)
    worlds = {}
    for world in scores.experiment.world:
        in_world = outcomes.get(world, [])
        completed = sum(outcome.completed for outcome in in_world)
        bounds = validation.bound_rate(completed, len(in_world))
        worlds[world] = Rate(completed, len(in_world), *bounds)
    rivals = [
        Rival(
            number,
            len(met),
            scores.combine(met),
            compute_chance(found, met, scores.combine),
            number in leaders,
        )
        for number, met in scores.validated.items()
        if number != own.id and met
    ]
    return Certificate(
        own.id,
        choice.fitness,
        choice.trials,
        scores.combine(found) if found else math.nan,
        len(found),
        validation.confidence,
        low,
        high,
        validation.precision,
        worlds,
        rivals,
        combine_chances([rival.chance for rival in rivals]),
        choice.finalists,
    )
