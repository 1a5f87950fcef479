"""The genes that a controller and its parts declare."""

from dataclasses import dataclass, field

import pytest

from evoros.base.errors import InputError
from evoros.controller.protocol import ControllerPart, EvolvedValue
from evoros.mission.member import find_declared_genes


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
