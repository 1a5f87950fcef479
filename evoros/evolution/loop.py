"""The evolution: ask for designs, evaluate them, tell their fitness, record the generation."""

from evoros.dispatch.dispatcher import Dispatcher
from evoros.evolution.champions import keep_missions, list_champions, record_champion
from evoros.evolution.ending import certify, choose_champion
from evoros.evolution.experiment import ALL, CHAMPIONS, Experiment
from evoros.evolution.journal import Ending, Journal, Watcher
from evoros.evolution.measuring import Measuring
from evoros.evolution.scores import Scores
from evoros.evolution.trials import Trials
from evoros.executor.protocol import Pool


def evolve(
    experiment: Experiment, journal: Journal, watcher: Watcher, generations: int, pool: Pool
) -> Ending:
    """Run the experiment for so many generations, and record its champion, which is certified.

    Missions that the journal has are not run again; so an interrupted run continues.

    Raises:
        InputError: the journal is of another run, or a part refuses its input.
        RunStopped: a mission crashed or hung, and the experiment stops at that.
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
        watcher.generation(generation)
    champions = search.champions()
    journal.write_champions(list_champions(scores, champions))
    if experiment.record == CHAMPIONS and not experiment.scenario.is_live:
        keep_missions(scores, champions if len(champions) > 1 else [])
    choice = choose_champion(scores, generation)
    certificate = certify(scores.validated, generation, choice)
    record_champion(scores, choice.individual, certificate)
    return Ending(generation, certificate)
