"""A fitness is called by its own name, and never by another's."""

from collections.abc import Sequence
from dataclasses import dataclass

import pytest

from evoros.fitness.equation_one import EquationOne
from evoros.fitness.naming import FitnessName, name_fitness
from evoros.fitness.protocol import Fitness
from evoros.fitness.scoring import Scoring
from evoros.fitness.worst_case import WorstCase
from evoros.mission.mission import Outcome


@dataclass(frozen=True)
class CarefulURDFDriver2(Fitness):
    def score(self, outcomes: Sequence[Outcome]) -> float:
        return 0.0

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        return 0.0


class PlanB(CarefulURDFDriver2):
    pass


@dataclass(frozen=True)
class Distance(CarefulURDFDriver2):
    title = "distance driven"
    unit = "m"


@pytest.mark.parametrize(
    ("fitness", "label"),
    [
        (Distance(), "distance driven [m]"),
        (CarefulURDFDriver2(), "fitness (careful URDF driver 2)"),
        (PlanB(), "fitness (plan b)"),
        (EquationOne(), "fitness (Eq. 1)"),
        (EquationOne(sensor_penalty=0.3), "fitness (Eq. 1 less penalties)"),
        (EquationOne(price_weight=0.1), "fitness (Eq. 1 less penalties)"),
        (WorstCase(Distance(), 0.25), "distance driven, mean of the lowest 25 % [m]"),
    ],
)
def test_the_label_has_title_and_unit(fitness: Fitness, label: str) -> None:
    assert name_fitness(fitness).label == label
    assert Scoring(fitness).name.label == label


def test_the_label_of_several_robots_names_their_mean() -> None:
    assert Scoring(Distance(), (0, 2)).name.label == "distance driven, mean over the robots [m]"


@pytest.mark.parametrize("fitness", [Distance(), CarefulURDFDriver2(), WorstCase(Distance())])
def test_only_equation_one_is_called_so(fitness: Fitness) -> None:
    assert "Eq" not in name_fitness(fitness).label


def test_an_unknown_fitness_has_the_word_alone() -> None:
    assert FitnessName().label == "fitness"
