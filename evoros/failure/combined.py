"""Several failures in one mission."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated

from numpy.random import Generator

from evoros.base import rng as randomness
from evoros.base.checks import checked, mapping_of
from evoros.failure.protocol import Failure, Fault
from evoros.filter.protocol import Channels

FAILURES = mapping_of(Failure, "failures")


@dataclass(frozen=True)
@checked
class CombinedFailure:
    """Several named failures, drawn independently; one sensor may be hit more than once.

    Their faults act in the order of the mapping.
    """

    failures: Annotated[Mapping[str, Failure], FAILURES] = field(default_factory=dict)

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """Return the faults of all failures; their names begin with the name of the failure.

        Each failure has its own generator, made from one draw and its name, so that adding a
        failure never shifts the draws of another.
        """
        key = rng.bytes(16).hex()
        return tuple(
            replace(fault, name=f"{name}.{fault.name}")
            for name, failure in self.failures.items()
            for fault in failure.draw(channels, randomness.generator(key, name))
        )
