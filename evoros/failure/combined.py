"""Several failures in a mission."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

from numpy.random import Generator

from evoros.base import rng as randomness
from evoros.base.checks import checked, mapping_of
from evoros.base.errors import InputError
from evoros.failure.protocol import AdaptiveFailure, Failure, Fault, SystematicFailure
from evoros.filter.protocol import Channels

FAILURES = mapping_of(Failure, "failures")


@dataclass(frozen=True)
@checked
class CombinedFailure(Failure):
    """Several named failures, drawn independently, which act in the order of the mapping."""

    failures: Annotated[Mapping[str, Failure], FAILURES] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, failure in self.failures.items():
            if isinstance(failure, SystematicFailure | AdaptiveFailure):
                raise InputError(
                    f"failure.failures.{name}: must be drawn for each mission, but "
                    f"{type(failure).__name__} spreads cases over trials; use it alone "
                    f"(failure=...), or remove it"
                )

    @property
    def parts(self) -> Sequence[str]:
        parts = (part for failure in self.failures.values() for part in failure.parts)
        return tuple(dict.fromkeys(parts))

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """Return the faults of all failures; adding a failure leaves all other draws unchanged."""
        key = rng.bytes(16).hex()
        return tuple(
            replace(fault, name=f"{name}.{fault.name}")
            for name, failure in self.failures.items()
            for fault in failure.draw(channels, randomness.generator(key, name))
        )
