"""The genes that a controller declares, as genes of the design space."""

import dataclasses
from collections.abc import Iterator, Mapping

from evoros.base.errors import InputError
from evoros.controller.protocol import EvolvedValue, EvolvingPart
from evoros.design.genes import Gene

CONTROLLER = "controller"


def find_declared_genes(controller: object) -> dict[str, Gene]:
    """Return the genes of a controller and of its parts, such as layers, by name.

    Raises:
        InputError: two have the same name, or one is no gene.
    """
    genes: dict[str, Gene] = {}
    for at, name, value in _list_declared(controller, CONTROLLER):
        if name in genes:
            raise InputError(
                f"{at}: must not declare the gene {name}, which another part of the controller "
                f"declares too; rename it in its class"
            )
        low, high = float(value.low), float(value.high)
        genes[name] = Gene(f"{at}.{value.path}", low, high, group=value.group or None)
    return genes


def _list_declared(part: object, at: str) -> Iterator[tuple[str, str, EvolvedValue]]:
    """Yield the key of the part that declares a gene, the gene's name, and its value."""
    if isinstance(part, EvolvingPart):
        for name, value in part.evolved.items():
            yield at, name, value
    if dataclasses.is_dataclass(part):
        for field in dataclasses.fields(part):
            yield from _list_declared(getattr(part, field.name), f"{at}.{field.name}")
    elif isinstance(part, Mapping):
        for key, child in part.items():
            yield from _list_declared(child, f"{at}.{key}")
