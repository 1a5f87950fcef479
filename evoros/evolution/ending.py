"""The end of a run: the choice of the champion, and its certificate on fresh draws."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from evoros.certificate.certificate import Certificate, Finalist, Rate, Rival
from evoros.certificate.validation import Validation, combine_chances, compute_chance
from evoros.evolution.contest import Contest
from evoros.evolution.journal import Generation
from evoros.evolution.scores import Scores
from evoros.evolution.trials import Validated
from evoros.fitness.naming import UNBOUNDED, bound_fitness
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
    """Return the last generation's best, or the one that the final choice finds."""
    experiment = scores.trials.experiment
    final, combine = experiment.final_choice, experiment.combine
    if final is None:
        best = last.best.individual
        by_fitness = sorted(last.candidates, key=lambda row: -row.fitness)
        alive = {row.individual.id: row.individual for row in by_fitness if row.survived}
        alive.pop(best.id, None)
        return Choice(best, last.best.fitness, last.trials[best.id], list(alive.values()), [])
    individuals = scores.ledger.finalists
    fitness = scores.ledger.find_fitness(individuals)
    finalists = final.find_finalists(fitness)
    designs = scores.trials.decode([individuals[i] for i in finalists])
    contest = Contest(final.method, 1, {i: [] for i in finalists}, combine)
    while wanted := contest.next_round():
        missions = {
            i: experiment.plan.final(last.number, i, designs[i], trials)
            for i, trials in wanted.items()
        }
        contest.add(scores.trials.score(last.number, missions, FINAL))
    final_fitness, stayed = contest.fitness(), contest.stays()
    order = sorted(finalists, key=lambda i: (-stayed[i], -final_fitness[i]))
    table = [
        Finalist(i, fitness[i], len(contest.scores[i]), combine(contest.scores[i])) for i in order
    ]
    ranked = [individuals[i] for i in order]
    return Choice(ranked[0], table[0].final_fitness, table[0].trials, ranked[1:], table)


def certify(validated: Validated, last: Generation, choice: Choice) -> Certificate:
    """Validate the champion as precisely as the experiment asks, and compare it with its rivals.

    Rivals are all designs that have been validated, on the same draws.
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
    least, most = bound_fitness(experiment.fitness, len(experiment.world)) or UNBOUNDED
    low, high = (
        min(max(end, least), most) for end in validation.bound_fitness(scores, len(first), combine)
    )
    rivals = [
        Rival(i, len(met), combine(met), compute_chance(scores, met, combine), i in leaders)
        for i, met in validated.scores.items()
        if i != champion.id and met
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
        failed_parts=_rate_parts(validation, [item for met in outcomes.values() for item in met]),
    )


def _rate_parts(validation: Validation, outcomes: Sequence[Outcome]) -> dict[str, Rate]:
    """Rate the missions in which each part failed, by its name and the effect."""
    met: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        failed = zip(outcome.failed_parts, outcome.parts_failed_by, strict=True)
        for name in dict.fromkeys(f"{part}: {effect}" for part, effect in failed):
            met.setdefault(name, []).append(outcome)
    return {name: _rate(validation, met[name]) for name in sorted(met)}


def _rate(validation: Validation, outcomes: Sequence[Outcome]) -> Rate:
    completed = sum(outcome.completed for outcome in outcomes)
    return Rate(completed, len(outcomes), *validation.bound_rate(completed, len(outcomes)))
