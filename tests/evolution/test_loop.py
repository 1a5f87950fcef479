"""The loop of an evolution writes to a journal of any kind and answers from its record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from helpers import USER_PARTS, finished_run
from hypothesis import given
from hypothesis import strategies as st

from evoros import load_run
from evoros.allocation.successive_rejects import SuccessiveRejects
from evoros.base.arrays import Array
from evoros.certificate.final_choice import FinalChoice
from evoros.config.compose import compose
from evoros.dispatch.dispatcher import MissionResult
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Champion, Champions, Generation, Watcher
from evoros.evolution.loop import evolve
from evoros.evolution.scores import Ledger, NumberLog
from evoros.measure.coverage import Coverage
from evoros.mission.mission import Mission, MissionKey, Outcomes
from evoros.mission.plan import CONFIRMATION
from evoros.mission.scenario import Scenario
from evoros.optimizer.map_elites import MapElites
from evoros.optimizer.protocol import Individual


@dataclass
class Memory(Watcher):
    """A journal and an observer in memory, with all that happened in order."""

    outcomes: dict[MissionKey, Outcomes] = field(default_factory=dict)
    purposes: dict[MissionKey, str] = field(default_factory=dict)
    generations: list[Generation] = field(default_factory=list)
    champion: Champion | None = None
    tracks: Mapping[str, Array] = field(default_factory=dict)
    trajectories: dict[MissionKey, Array] = field(default_factory=dict)
    events: list[str] = field(default_factory=list)

    def has(self, mission: Mission) -> bool:
        return mission.key in self.outcomes

    def find(self, mission: Mission) -> Outcomes | None:
        return self.outcomes.get(mission.key)

    def record(self, results: Sequence[MissionResult]) -> None:
        self.outcomes |= {mission.key: outcome for mission, outcome in results}
        self.purposes |= {mission.key: mission.purpose for mission, _ in results}
        self.events.append("recorded")

    def keep_log(self, mission: Mission, log: str) -> None:
        self.events.append("log kept")

    def drop_trajectories(self, missions: Sequence[Mission]) -> list[Mission]:
        return list(missions)

    def keep_trajectory(self, scenario: Scenario, mission: Mission, trajectory: Array) -> None:
        self.trajectories[mission.key] = trajectory

    def read_trajectory(self, mission: Mission) -> Array:
        return self.trajectories[mission.key]

    def write_generation(self, generation: Generation) -> None:
        self.generations.append(generation)
        self.events.append("generation written")

    def write_champions(self, champions: Champions) -> None:
        self.designs = list(champions.designs)

    def has_champion(self, champion: Champion) -> bool:
        return self.champion is not None and self.champion.id == champion.id

    def write_champion(self, champion: Champion, trajectories: Mapping[str, Array]) -> None:
        self.champion, self.tracks = champion, trajectories
        self.events.append("champion written")

    def begin(self, generation: int, missions: int, known: int) -> None:
        self.events.append(f"{known} of {missions} known")

    def mission(self, mission: Mission, outcomes: Outcomes) -> None:
        assert self.outcomes[mission.key] is outcomes

    def generation(self, generation: Generation) -> None:
        assert self.generations[-1] is generation


@pytest.mark.slow
@pytest.mark.parametrize("more", [(), ("confirmation=strict", "optimizer.population_size=6")])
def test_a_journal_in_memory_has_what_a_run_folder_has(more: Sequence[str], tmp_path: Path) -> None:
    run = load_run(finished_run(tmp_path / "run", *more))
    experiment = build(*more)
    memory = Memory()
    generations = experiment.optimizer.generations
    with experiment.executor.open() as pool:
        last = evolve(experiment, memory, memory, generations, pool).last
    assert last is memory.generations[-1]
    assert len(memory.outcomes) == len(run.missions)
    for generation in memory.generations:
        table = run.generations[run.generations.generation == generation.number]
        assert list(table.fitness) == [candidate.fitness for candidate in generation.candidates]
        assert list(table.id) == [candidate.individual.id for candidate in generation.candidates]
        best = table[table.id == generation.best.individual.id].iloc[0]
        assert best.validated_fitness == generation.validated
        assert ("loss" in table) == bool(more) == (generation.loss is not None)
    assert memory.champion is not None
    assert set(run.champion.design) == {memory.champion.id}
    assert set(memory.tracks) == set(experiment.world)
    for world, track in memory.tracks.items():
        assert run.trajectory(world).to_numpy().shape == track.shape


def build(*overrides: str) -> Experiment:
    typed = ["experiment=tiny", "executor=serial", *overrides]
    return compose(typed, config_dir=USER_PARTS).build()


def test_what_the_journal_has_is_not_run_again() -> None:
    """The trajectories of the champion are those of missions that count for its fitness."""
    experiment = build("confirmation=strict")
    memory = Memory()
    with experiment.executor.open() as pool:
        first = evolve(experiment, memory, memory, 2, pool)
        memory.events.clear()
        again = evolve(experiment, memory, memory, 2, pool)
    assert again.last.summary == first.last.summary
    assert again.certificate == first.certificate
    assert not {"recorded", "champion written"} & set(memory.events)
    known = [event.split() for event in memory.events if event.endswith("known")]
    assert known
    assert all(words[0] == words[2] for words in known)
    champion = memory.champion
    assert champion is not None
    for world, track in memory.tracks.items():
        steps = np.diff(track[:, 1:3], axis=0)
        length = sum(np.sqrt((steps * steps).sum(axis=1)).tolist())
        (counted,) = (
            outcome.distance_m
            for key, (outcome,) in memory.outcomes.items()
            if key[1:3] == (champion.id, world) and memory.purposes[key] == CONFIRMATION
        )
        assert length == counted


def test_trajectories_of_all_champions_are_kept_if_wanted() -> None:
    search = MapElites(population_size=4, generations=1, validation_trials=0)
    descriptors = {"coverage": Coverage()}
    experiment = replace(build("record=champions"), optimizer=search, descriptors=descriptors)
    memory = Memory()
    with experiment.executor.open() as pool:
        evolve(experiment, memory, memory, 1, pool)
    assert len(memory.designs) > 1
    assert {design for _, design, *_ in memory.trajectories} == set(memory.designs)


NUMBERS = st.floats(allow_nan=False)


@given(st.lists(st.tuples(st.integers(0, 9), NUMBERS, NUMBERS)))
def test_a_log_finds_the_rows_of_each_individual_in_their_order(
    rows: list[tuple[int, float, float]],
) -> None:
    log = NumberLog(2)
    for individual, *row in rows:
        log.add(individual, row)
    expected = {design_id: [row for i, *row in rows if i == design_id] for design_id in range(10)}
    assert log.find(range(10)) == expected
    seen = {individual for individual, *_ in rows}
    assert log.find_last(seen) == {design_id: expected[design_id][-1] for design_id in seen}


def test_a_log_can_grow_after_it_was_read() -> None:
    log = NumberLog(1)
    for row in range(100):
        log.add(1, [row])
        assert log.find_last([1]) == {1: [row]}


def test_rows_are_found_among_many() -> None:
    log = NumberLog(1)
    for row in range(9000):
        log.add(row % 5000, [row])
    assert log.find([0, 4999]) == {0: [[0], [5000]], 4999: [[4999]]}
    assert log.find([-1]) == {-1: []}


def test_a_log_refuses_a_row_of_another_width() -> None:
    with pytest.raises(ValueError, match="must have 2 numbers, not 1"):
        NumberLog(2).add(0, [1.0])


@given(st.data())
def test_the_finalists_are_those_of_a_ledger_that_forgets_nobody(data: st.DataObject) -> None:
    final = FinalChoice(SuccessiveRejects(budget=1), finalists=data.draw(st.integers(1, 4)))
    ledger, told = Ledger(0, final), dict[int, float]()
    alive: list[Individual] = []
    for generation in range(data.draw(st.integers(1, 6))):
        new = [Individual(3 * generation + i, np.zeros(1), (), "initial") for i in range(3)]
        for individual in [*new, *alive]:  # survivors are scored again
            told[individual.id] = data.draw(st.integers(0, 5))
            ledger.told.add(individual.id, [told[individual.id]])
        ledger.keep_finalists([*new, *alive])
        kept = ledger.find_fitness(ledger.finalists)
        assert final.find_finalists(kept) == final.find_finalists(told)
        alive = data.draw(st.lists(st.sampled_from([*new, *alive]), unique_by=id))
