"""Scoring each generation's best again in another simulator."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from evoros.base.checks import COUNT, check, instance_of
from evoros.simulator.protocol import Simulator


@dataclass(frozen=True)
class Confirmation:
    """The best new designs of each generation fly their missions again in ``simulator``.

    What they get there is their fitness, so that a search in a simple simulator cannot live on
    what that one leaves out.

    Raises:
        InputError: a part of the wrong kind, or a number below 1.
    """

    simulator: Simulator
    best: int = 3  # of each generation's new designs

    def __post_init__(self) -> None:
        check(
            self,
            simulator=instance_of(Simulator, "a simulator (time_step and open)"),
            best=COUNT,
        )

    def settle(
        self,
        screened: Mapping[int, float],
        confirm: Callable[[list[int]], Mapping[int, float]],
    ) -> dict[int, float]:
        """The confirmed fitness of the designs that need one, by their id.

        ``screened`` has the fitness of all new designs in the run's own simulator; ``confirm``
        gives that of some of them in the confirming one. A design that loses there makes room for
        another, which is confirmed in turn: at the end the ``best`` designs, by the confirmed
        fitness where there is one and else by the screened, are all confirmed. No design is
        confirmed twice. Of equals the first in ``screened`` is the better.
        """
        confirmed: dict[int, float] = {}
        while True:
            fitness = {**screened, **confirmed}
            best = sorted(fitness, key=fitness.__getitem__, reverse=True)[: self.best]
            doubtful = [one for one in best if one not in confirmed]
            if not doubtful:
                return confirmed
            confirmed.update(confirm(doubtful))
