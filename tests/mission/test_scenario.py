"""What a scenario refuses, and the genes that a controller and its parts declare."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.controller.protocol import ControllerPart, EvolvedValue
from evoros.mission.member import find_declared_genes
from evoros.simulator.protocol import PlacedRobot, Simulator
from evoros.world.model import World


class Lonely(Simulator):
    """A user's simulator of one robot, without walkers."""

    time_step = 0.02
    packages = ()

    def open(self, robots: Sequence[PlacedRobot], world: World) -> Any:
        raise NotImplementedError


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("experiment=two_rovers", "agents: there must be at most 0, not 1, because Lonely"),
        ("walkers=people", "walkers: must be empty with Lonely"),
    ],
)
def test_a_simulator_of_one_robot_alone_is_refused(override: str, message: str) -> None:
    scenario = compose([override, "world=boxes", "executor=serial"]).build().scenario
    with pytest.raises(InputError, match=message):
        replace(scenario, simulator=Lonely())


@dataclass(frozen=True)
class Layer(ControllerPart):
    """A part of a controller, which declares one gene."""

    name: str

    @property
    def evolved(self) -> dict[str, EvolvedValue]:
        return {self.name: EvolvedValue("gain", 0.0, 2.0)}


@dataclass(frozen=True)
class Nest:
    """A part that declares nothing itself."""

    inner: object
    layers: dict[str, object] = field(default_factory=dict)


def test_parts_declare_genes_at_any_depth_in_fields_and_mappings() -> None:
    controller = Nest(Nest(Layer("deep")), {"avoid": Layer("near"), "plain": 3.0})
    genes = find_declared_genes(controller)
    assert {name: gene.key for name, gene in genes.items()} == {
        "deep": "controller.inner.inner.gain",
        "near": "controller.layers.avoid.gain",
    }
    assert {(gene.low, gene.high) for gene in genes.values()} == {(0.0, 2.0)}


def test_two_parts_do_not_declare_the_same_gene() -> None:
    with pytest.raises(InputError, match="must not declare the gene same"):
        find_declared_genes(Nest(Layer("same"), {"other": Layer("same")}))
