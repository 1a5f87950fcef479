"""The evolution: ask for designs, evaluate them, tell their fitness, record the generation."""

from collections.abc import Sequence
from contextlib import suppress

from evoros.base.errors import InputError
from evoros.evolution.certificate import Certificate
from evoros.evolution.dispatch import Dispatcher
from evoros.evolution.ending import certify, choose_champion
from evoros.evolution.experiment import ALL, CHAMPION, NONE, Experiment
from evoros.evolution.journal import Champion, Champions, Ending, Journal, Observer
from evoros.evolution.measuring import name_measures
from evoros.evolution.scores import Scores
from evoros.executor.protocol import Pool
from evoros.mission.plan import CONFIRMATION, SELECTION
from evoros.optimizer.protocol import Individual
from evoros.robot.model import Robot


def evolve(
    experiment: Experiment, journal: Journal, observer: Observer, generations: int, pool: Pool
) -> Ending:
    """Run the experiment for so many generations, and record its champion, which is certified.

    Missions that the journal has are not run again; so an interrupted run goes on where it ended.

    Raises:
        InputError: the journal is of another run, or a part refuses what it is given.
        RunStopped: a mission crashed or hung, and the experiment stops at that.
    """
    keep = journal.keep_trajectory if experiment.record == ALL else None
    dispatcher = Dispatcher(pool, experiment.lost_missions, journal.keep_log, keep)
    scores = Scores(experiment, journal, observer, dispatcher)
    search = experiment.start_search()
    for number in range(generations):
        individuals = search.ask()
        candidates = search.tell(scores.evaluate(number, individuals))
        generation = scores.conclude(number, candidates)
        journal.write_generation(generation)
        observer.generation(generation)
    journal.write_champions(_list_champions(scores, search.champions()))
    choice = choose_champion(scores, generation)
    certificate = certify(scores, generation, choice)
    champion = choice.individual
    shown = scores.ledger.find_shown(champion.id)
    _record_champion(experiment, journal, dispatcher, champion, certificate, *shown)
    return Ending(generation, certificate)


def _list_champions(scores: Scores, individuals: Sequence[Individual]) -> Champions:
    """Return what a search has found, with its scores."""
    names = ["fitness", *name_measures(scores.experiment)]
    told = scores.ledger.find_told(each.id for each in individuals)
    return Champions(
        designs=scores.decode(individuals),
        scores=[dict(zip(names, told[each.id], strict=True)) for each in individuals],
        gene_names=_name_genes(scores.experiment),
    )


def _name_genes(experiment: Experiment) -> dict[str, dict[str, str]]:
    """Return the name of each gene by the robot and the key."""
    return {
        name: {gene.key: title for title, gene in member.design.genes.items()}
        for name, member in experiment.members.items()
    }


def _record_champion(
    experiment: Experiment,
    journal: Journal,
    dispatcher: Dispatcher,
    individual: Individual,
    certificate: Certificate,
    generation: int,
    earlier: int,
) -> None:
    """Record the champion, with the trajectories of its first mission in each world.

    These are missions that gave the champion its fitness, confirming ones if there are any.
    """
    purpose = CONFIRMATION if experiment.confirmation else SELECTION
    scenario, design = experiment.scenario_for(purpose), experiment.space.decode(individual.genome)
    plan = experiment.plan.confirmation if experiment.confirmation else experiment.plan.selection
    missions = plan(generation, individual.id, design, range(1), earlier)
    robots: dict[str, Robot] = {}
    with suppress(InputError):  # a part refuses every design of the run, and so this one
        robots = {name: each.robot for name, each in scenario.equip(design).items()}
    champion = Champion(
        id=individual.id,
        design=design,
        gene_names=_name_genes(experiment),
        robots=robots,
        worlds={each.world: scenario.world[each.world].at(each.draws) for each in missions},
        tracks=[] if experiment.record == NONE else [each.world for each in missions],
        columns=scenario.name_columns(design),
        certificate=certificate,
    )
    if not journal.has_champion(champion):
        if experiment.record == CHAMPION:
            tracks = dispatcher.run_for_trajectories(scenario, missions)
        else:
            kept = missions[: len(champion.tracks)]
            tracks = [journal.read_trajectory(mission) for mission in kept]
        journal.write_champion(champion, dict(zip(champion.tracks, tracks, strict=True)))
