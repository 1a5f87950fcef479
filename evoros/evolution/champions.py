"""Records the designs of a finished search, with trajectories of their first missions."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from evoros.base.errors import InputError
from evoros.certificate.certificate import Certificate
from evoros.evolution.experiment import ALL, NONE, Experiment
from evoros.evolution.journal import Champion, Champions
from evoros.evolution.measuring import list_measures
from evoros.evolution.scores import Scores
from evoros.mission.mission import Mission
from evoros.optimizer.protocol import Individual
from evoros.robot.model import Robot
from evoros.terminal.log import LOGGER

MOST_SHOWN = 100
"""Maximum number of designs of an archive or a front whose trajectories a run keeps."""


def list_champions(scores: Scores, individuals: Sequence[Individual]) -> Champions:
    """Return the designs of a finished search, with their scores."""
    experiment = scores.trials.experiment
    names = ["fitness", *list_measures(experiment)]
    told = scores.ledger.find_told(individual.id for individual in individuals)
    return Champions(
        designs=scores.trials.decode(individuals),
        scores=[dict(zip(names, told[one.id], strict=True)) for one in individuals],
        gene_names=_name_genes(experiment),
    )


def _name_genes(experiment: Experiment) -> dict[str, dict[str, str]]:
    """Return the name of each gene by the robot and the key."""
    return {
        name: {gene.key: title for title, gene in space.genes.items()}
        for name, space in experiment.space.spaces.items()
    }


def keep_missions(scores: Scores, individuals: Sequence[Individual]) -> None:
    """Keep the trajectories of first missions of these individuals, and drop all others.

    The designs are spread evenly over their ranks, the best one included.
    """
    last = len(individuals) - 1
    count = min(len(individuals), MOST_SHOWN)
    ranks = [round(i * last / max(count - 1, 1)) for i in range(count)]
    missions = [mission for rank in ranks for mission in _list_first(scores, individuals[rank])]
    trials, journal = scores.trials, scores.trials.journal
    missing = journal.drop_trajectories(missions)
    if missing:
        again = "%d missions of %d designs are run again to keep their trajectories; %s"
        LOGGER.info(again, len(missing), count, "record=champion leaves them out")
    keeping = replace(trials.dispatcher, keep_trajectory=journal.keep_trajectory)
    for purpose in dict.fromkeys(mission.purpose for mission in missing):
        selected = [mission for mission in missing if mission.purpose == purpose]
        for _ in keeping.run(trials.experiment.scenario_for(purpose), selected):
            pass  # their outcomes are recorded


def _list_first(scores: Scores, individual: Individual) -> list[Mission]:
    """List an individual's first mission in each world, of those that gave it its fitness."""
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
    with suppress(InputError):  # a part refuses every design of the run, and so this one
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
