"""The evolution loop: asks for designs, evaluates and records them, certifies the champion."""

import math
from collections.abc import Callable, Container, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from evoros.base.combining import mean
from evoros.base.errors import InputError
from evoros.certificate import rates
from evoros.certificate.certificate import Certificate, Finalist, Rate, Rival
from evoros.certificate.final_choice import find_finalists
from evoros.certificate.validation import MOST_REPEATS, Validation, estimate_trials, list_looks
from evoros.dispatch.dispatcher import Dispatcher
from evoros.evolution.contest import Contest
from evoros.evolution.experiment import ALL, CHAMPIONS, NONE, Experiment
from evoros.evolution.journal import Champion, Champions, Ending, Generation, Journal, Watcher
from evoros.evolution.scores import Scores
from evoros.evolution.stop_after import Spent
from evoros.evolution.trials import FreshTrials, Measuring, Trials, Validated, list_measures
from evoros.executor.protocol import Pool
from evoros.fitness.naming import UNBOUNDED
from evoros.mission.mission import Mission, Outcome
from evoros.mission.plan import FINAL
from evoros.optimizer.protocol import Individual
from evoros.robot.model import Robot
from evoros.terminal.log import LOGGER


@dataclass
class Judgement:
    """Compares a champion with the other validated designs, on fresh draws."""

    validated: Validated
    champion: Individual

    def __post_init__(self) -> None:
        self.experiment = self.validated.trials.experiment
        # confidence of each interim look at the interval
        self.confidence = self.experiment.validation.confidence

    @property
    def fresh(self) -> FreshTrials:
        """The champion's trials on fresh draws so far."""
        return self.validated.fresh[self.champion.id]

    def bound(self, design: int, confidence: float) -> rates.Bounds:
        """Return the fitness interval of a validated design; NaN if unknown."""
        fresh = self.validated.fresh[design]
        if not fresh.trials:
            return math.nan, math.nan
        if self.experiment.scoring.combine is mean:
            return rates.bound_mean(fresh.scores, *self._limit(fresh), confidence)
        return self.experiment.scoring.bound_combined(fresh.trials, self._limit(fresh), confidence)

    def _limit(self, fresh: FreshTrials) -> rates.Bounds:
        """Return the assumed minimum and maximum score of a design."""
        lowest, highest = self.experiment.fitness_bounds or UNBOUNDED
        if math.isinf(highest):
            known = (other.scores for other in self.validated.fresh.values() if other.scores)
            highest = rates.guess_highest(fresh.scores, max(map(max, known)))
        return max(lowest, fresh.lowest), highest

    def reach_precision(self, recorded: float) -> int | None:
        """Add trials until the interval is narrow enough, up to ``max_trials``.

        The looks depend on the ``recorded`` fitness, which is independent of the validation draws.
        Return the estimated number of trials required if the precision was missed.
        """
        validation, precision = self.experiment.validation, self.experiment.validation.precision
        assert precision is not None
        lowest, highest = self.experiment.fitness_bounds or UNBOUNDED
        below, above = (
            max(0.0, width) if math.isfinite(width) else 0.0
            for width in (recorded - lowest, highest - recorded)
        )
        missions = self.experiment.scored_missions
        looks = list_looks(validation, len(self.fresh.trials), missions, (below, above))
        self.confidence = rates.share_level(validation.confidence, len(looks))
        self._log_estimate(looks)
        for count in looks:
            fresh = self.validated.extend(self.champion, count)
            low, high = self.bound(self.champion.id, self.confidence)
            if high - low <= 2 * precision:
                return None
        limits = self._limit(fresh)
        return estimate_trials(fresh.scores, count, limits, self.confidence, precision)

    def _log_estimate(self, looks: Sequence[int]) -> None:
        fresh, precision = self.fresh, self.experiment.validation.precision
        if not fresh.scores or precision is None:
            return
        known = len(fresh.trials)
        limits = self._limit(fresh)
        wanted = estimate_trials(fresh.scores, known, limits, self.confidence, precision)
        more = "" if wanted else "more than "
        text = f"{more}{max(wanted or MOST_REPEATS * known, looks[0])}"
        LOGGER.info(
            "validation.precision: %g will probably need %s trials of the champion, judging by the "
            "first %d; validation.max_trials allows %d",
            *(precision, text, known, looks[-1]),
        )

    def list_rivals(self, leaders: Container[int]) -> list[Rival]:
        """Return the other validated designs with simultaneous intervals.

        The upper ends of the rivals' intervals share the error rate that the lower end of the
        champion's interval leaves, so their difference bounds any rival's advantage from above at
        the given confidence. The opposite ends bound it from below. ``leaders`` led a generation.
        """
        combine = self.experiment.scoring.combine
        others = {i: one for i, one in self.validated.fresh.items() if i != self.champion.id}
        others = {i: one for i, one in others.items() if one.trials}
        confidence = rates.share_level(self.experiment.validation.confidence, max(1, len(others)))
        return [
            Rival(
                i,
                len(fresh.trials),
                round(combine(fresh.trials), rates.DIGITS),
                *self.bound(i, confidence),
                i in leaders,
            )
            for i, fresh in others.items()
        ]


@dataclass(frozen=True)
class Choice:
    """The champion, the fitness by which it was chosen, and the other designs, best first."""

    individual: Individual
    fitness: float
    trials: int
    others: list[Individual]
    finalists: list[Finalist]


def choose_champion(scores: Scores, last: Generation) -> Choice:
    """Return the best design of the last generation, or the winner of the final choice."""
    experiment = scores.trials.experiment
    final, combine = experiment.final_choice, experiment.scoring.combine
    if final is None:
        best = last.best.individual
        by_fitness = sorted(last.candidates, key=lambda row: -row.fitness)
        alive = {row.individual.id: row.individual for row in by_fitness if row.survived}
        alive.pop(best.id, None)
        return Choice(best, last.best.fitness, last.trials[best.id], list(alive.values()), [])
    individuals = scores.ledger.finalists
    fitness = scores.ledger.find_fitness(individuals)
    finalists = find_finalists(final, fitness)
    designs = scores.trials.decode([individuals[i] for i in finalists])
    contest = Contest(final.method, 1, {i: [] for i in finalists}, combine)
    while wanted := contest.next_round():
        missions = {
            i: experiment.plan.final(last.number, i, designs[i], trials)
            for i, trials in wanted.items()
        }
        contest.add(scores.trials.score(last.number, missions, FINAL))
    scores.validated.compared = contest.compared
    final_fitness, stayed = contest.fitness(), contest.stays()
    order = sorted(finalists, key=lambda i: (-stayed[i], -final_fitness[i]))
    table = [
        Finalist(i, fitness[i], len(contest.scores[i]), combine(contest.scores[i])) for i in order
    ]
    ranked = [individuals[i] for i in order]
    return Choice(ranked[0], table[0].final_fitness, table[0].trials, ranked[1:], table)


def certify(validated: Validated, last: Generation, choice: Choice) -> Certificate:
    """Validate the champion to the required precision, and compare it with rivals."""
    experiment = validated.trials.experiment
    validation, combine = experiment.validation, experiment.scoring.combine
    champion, leaders = choice.individual, set(validated.fresh)
    for individual in [champion, *choice.others[: validation.rivals]]:
        validated.validate(last.number, individual)
    first = len(validated.fresh[champion.id].trials)
    validated.extend(champion, max(first, validation.trials or 0))
    judged = Judgement(validated, champion)
    wanted = None if validation.precision is None else judged.reach_precision(choice.fitness)
    fresh, outcomes = judged.fresh, judged.fresh.outcomes
    low, high = judged.bound(champion.id, judged.confidence)
    rivals = judged.list_rivals(leaders)
    return Certificate(
        design=champion.id,
        recorded_fitness=choice.fitness,
        recorded_trials=choice.trials,
        validated_fitness=combine(fresh.trials) if fresh.trials else math.nan,
        validated_trials=len(fresh.trials),
        confidence=validation.confidence,
        fitness_low=low,
        fitness_high=high,
        precision=validation.precision,
        precision_trials=wanted,
        worlds={world: _rate(validation, outcomes.get(world, [])) for world in experiment.world},
        rivals=rivals,
        rival_advantage=_find_advantage(rivals, low),
        finalists=choice.finalists,
        failed_parts=_rate_parts(validation, [item for met in outcomes.values() for item in met]),
    )


def _find_advantage(rivals: Sequence[Rival], low: float) -> float:
    """Return a bound on the advantage of rivals over the champion; NaN if there is none."""
    ends = [rival.high for rival in rivals]
    known = ends and not any(map(math.isnan, ends))
    return round(max(ends) - low, rates.DIGITS) if known else math.nan


def _rate_parts(validation: Validation, outcomes: Sequence[Outcome]) -> dict[str, Rate]:
    met: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        failed = zip(outcome.failed_parts, outcome.parts_failed_by, strict=True)
        for name in dict.fromkeys(f"{part}: {effect}" for part, effect in failed):
            met.setdefault(name, []).append(outcome)
    return {name: _rate(validation, met[name]) for name in sorted(met)}


def _rate(validation: Validation, outcomes: Sequence[Outcome]) -> Rate:
    completed = sum(outcome.completed for outcome in outcomes)
    bounds = rates.bound_rate(completed, len(outcomes), validation.confidence)
    return Rate(completed, len(outcomes), *bounds)


MOST_SHOWN = 100  # maximum number of designs in an archive or front with stored trajectories


def list_champions(scores: Scores, individuals: Sequence[Individual]) -> Champions:
    """Return the designs of a finished search with their scores."""
    experiment = scores.trials.experiment
    names = ["fitness", *list_measures(experiment)]
    told = scores.ledger.find_told(individual.id for individual in individuals)
    return Champions(
        designs=scores.trials.decode(individuals),
        scores=[dict(zip(names, told[one.id], strict=True)) for one in individuals],
        gene_names=_name_genes(experiment),
    )


def _name_genes(experiment: Experiment) -> dict[str, dict[str, str]]:
    return {
        name: {gene.key: title for title, gene in space.genes.items()}
        for name, space in experiment.space.spaces.items()
    }


def keep_missions(scores: Scores, individuals: Sequence[Individual]) -> None:
    """Keep the trajectories of the first missions of individuals; delete all others."""
    # If there are too many individuals, select them evenly by rank.
    last = len(individuals) - 1
    count = min(len(individuals), MOST_SHOWN)
    ranks = [round(i * last / max(count - 1, 1)) for i in range(count)]
    missions = [mission for rank in ranks for mission in _list_first(scores, individuals[rank])]
    trials, journal = scores.trials, scores.trials.journal
    missing = journal.drop_trajectories(missions)
    if missing:
        again = "rerunning %d missions of %d designs to store their trajectories; %s"
        LOGGER.info(again, len(missing), count, "record=champion avoids this")
    keeping = replace(trials.dispatcher, keep_trajectory=journal.keep_trajectory)
    for purpose in dict.fromkeys(mission.purpose for mission in missing):
        selected = [mission for mission in missing if mission.purpose == purpose]
        for _ in keeping.run(trials.experiment.scenario_for(purpose), selected):
            pass  # the outcomes are already recorded


def _list_first(scores: Scores, individual: Individual) -> list[Mission]:
    experiment, design_id = scores.trials.experiment, individual.id
    plan, confirmed = experiment.plan, design_id in scores.confirmed.scores
    list_missions = plan.confirmation if confirmed else plan.selection
    generation, earlier = scores.ledger.find_shown(design_id)
    design = experiment.space.decode(individual.genome)
    cases = scores.opposition.list_cases(generation)
    return list_missions(generation, design_id, design, range(1), earlier, cases)


def record_champion(scores: Scores, individual: Individual, certificate: Certificate) -> None:
    """Record the champion, with the trajectories of its first missions."""
    experiment, journal = scores.trials.experiment, scores.trials.journal
    missions = _list_first(scores, individual)
    scenario, design = experiment.scenario_for(missions[0].purpose), missions[0].design
    robots: dict[str, Robot] = {}
    with suppress(InputError):  # a part rejects every design
        robots = {member.name: member.robot for member in scenario.equip(design)}
    champion = Champion(
        id=individual.id,
        design=design,
        gene_names=_name_genes(experiment),
        robots=robots,
        worlds={one.world: scenario.world[one.world].at(one.draws) for one in missions},
        tracks=[] if experiment.record == NONE else [mission.world for mission in missions],
        columns={one.world: scenario.name_columns(design, one.world) for one in missions},
        certificate=certificate,
    )
    if not journal.has_champion(champion):
        if experiment.record == ALL:
            tracks = [journal.read_trajectory(mission) for mission in missions]
        else:
            kept = missions[: len(champion.tracks)]
            tracks = scores.trials.dispatcher.run_for_trajectories(scenario, kept)
        journal.write_champion(champion, dict(zip(champion.tracks, tracks, strict=True)))


def evolve(
    experiment: Experiment,
    journal: Journal,
    watcher: Watcher,
    generations: int,
    pool: Pool,
    stops: Callable[[Spent], bool] = lambda _: False,
) -> Ending:
    """Run the experiment for a number of generations, and record its certified champion.

    Recorded missions are not repeated, so an interrupted run continues. ``stops`` receives the cost
    after each generation, and returns True to end the search.
    """
    keep = journal.keep_trajectory if experiment.record == ALL else None
    dispatcher = Dispatcher(pool, experiment.lost_missions, journal.keep_log, keep)
    trials = Trials(experiment, journal, watcher, dispatcher, Measuring(experiment))
    scores = Scores(trials)
    search = experiment.start_search()
    for index in range(generations):
        individuals = search.ask()
        told = scores.evaluate(index, individuals)
        generation = scores.conclude(index, search.tell(told), told)
        journal.write_generation(generation)
        trials.spent.generations = index + 1
        ends = stops(trials.spent)
        watcher.generation(generation)
        if ends:
            break
    champions = search.champions()
    journal.write_champions(list_champions(scores, champions))
    if experiment.record == CHAMPIONS and not experiment.scenario.is_live:
        keep_missions(scores, champions if len(champions) > 1 else [])
    choice = choose_champion(scores, generation)
    certificate = certify(scores.validated, generation, choice)
    record_champion(scores, choice.individual, certificate)
    return Ending(generation, certificate)
