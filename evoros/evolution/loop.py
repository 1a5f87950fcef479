"""The evolution: ask for designs, evaluate them, tell their fitness, record the generation."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from evoros.base.errors import InputError
from evoros.base.log import LOGGER
from evoros.evolution.certificate import Certificate
from evoros.evolution.dispatch import Dispatcher
from evoros.evolution.ending import certify, choose_champion
from evoros.evolution.experiment import ALL, CHAMPIONS, NONE, Experiment
from evoros.evolution.journal import Champion, Champions, Ending, Journal, Observer
from evoros.evolution.measuring import name_measures
from evoros.evolution.scores import Scores
from evoros.executor.protocol import Pool
from evoros.mission.mission import Mission
from evoros.optimizer.protocol import Individual
from evoros.robot.model import Robot

MOST_SHOWN = 100
"""Maximum number of designs of an archive or a front whose trajectories a run keeps."""


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
    found = search.champions()
    journal.write_champions(_list_champions(scores, found))
    if experiment.record == CHAMPIONS and not experiment.scenario.is_live:
        _keep_missions(scores, found if len(found) > 1 else [])
    choice = choose_champion(scores, generation)
    certificate = certify(scores, generation, choice)
    _record_champion(scores, choice.individual, certificate)
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
        name: {gene.key: title for title, gene in member.own_space.genes.items()}
        for name, member in experiment.members.items()
    }


def _keep_missions(scores: Scores, found: Sequence[Individual]) -> None:
    """Keep the trajectories of first missions of what a search has found, and drop all others.

    The designs are spread evenly over their ranks, the best one included.
    """
    last = len(found) - 1
    number = min(len(found), MOST_SHOWN)
    ranks = [round(i * last / max(number - 1, 1)) for i in range(number)]
    missions = [mission for rank in ranks for mission in _list_first(scores, found[rank])]
    missing = scores.journal.drop_trajectories(missions)
    if missing:
        again = "%d missions of %d designs are run again to keep their trajectories; %s"
        LOGGER.info(again, len(missing), number, "record=champion leaves them out")
    keeping = replace(scores.dispatcher, keep_trajectory=scores.journal.keep_trajectory)
    for purpose in dict.fromkeys(mission.purpose for mission in missing):
        own = [mission for mission in missing if mission.purpose == purpose]
        for _ in keeping.run(scores.experiment.scenario_for(purpose), own):
            pass  # their outcomes are recorded


def _list_first(scores: Scores, individual: Individual) -> list[Mission]:
    """List an individual's first mission in each world, of those that gave it its fitness."""
    experiment, number = scores.experiment, individual.id
    plan = experiment.plan.confirmation if number in scores.confirmed else experiment.plan.selection
    generation, earlier = scores.ledger.find_shown(number)
    design = experiment.space.decode(individual.genome)
    cases = scores.opposition.list_cases(generation)
    return plan(generation, number, design, range(1), earlier, cases)


def _record_champion(scores: Scores, individual: Individual, certificate: Certificate) -> None:
    """Record the champion, with the trajectories of its first missions."""
    experiment, journal = scores.experiment, scores.journal
    missions = _list_first(scores, individual)
    scenario, design = experiment.scenario_for(missions[0].purpose), missions[0].design
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
        if experiment.record == ALL:
            tracks = [journal.read_trajectory(mission) for mission in missions]
        else:
            kept = missions[: len(champion.tracks)]
            tracks = scores.dispatcher.run_for_trajectories(scenario, kept)
        journal.write_champion(champion, dict(zip(champion.tracks, tracks, strict=True)))
