"""Scoring each generation's best again in another simulator, or by another controller."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import COUNT, checked, instance_of
from evoros.controller.protocol import A_CONTROLLER, Controller, LiveController
from evoros.simulator.protocol import A_SIMULATOR, Simulator


@dataclass(frozen=True)
@checked
class Confirmation:
    """Repeats the missions of each generation's best new designs in ``simulator``.

    The fitness there is the fitness of these designs, so that a search in a simple simulator
    cannot exploit effects that its simulator leaves out. A ``controller`` replaces the run's there,
    for example by the software of the real robot.
    """

    simulator: Annotated[Simulator, A_SIMULATOR]
    best: Annotated[int, COUNT] = 3  # of each generation's new designs
    controller: Annotated[Controller | LiveController | None, A_CONTROLLER] = None

    def confirm_best(
        self, screened: Mapping[int, float], confirm: Callable[[list[int]], Mapping[int, float]]
    ) -> dict[int, float]:
        """Confirm designs until the ``best`` of all are confirmed; return their fitness by id.

        ``screened`` has the fitness of all new designs in the run's own simulator; ``confirm``
        returns the fitness of some in the confirming one. A design ranks by its confirmed fitness
        if it has one, and by its screened fitness otherwise. So one that loses fitness makes room
        for the next, which is confirmed in turn. No design is confirmed twice. Of equals the first
        in ``screened`` ranks higher.
        """
        confirmed: dict[int, float] = {}
        while True:
            fitness = {**screened, **confirmed}
            best = sorted(fitness, key=fitness.__getitem__, reverse=True)[: self.best]
            unconfirmed = [design_id for design_id in best if design_id not in confirmed]
            if not unconfirmed:
                return confirmed
            confirmed.update(confirm(unconfirmed))


A_CONFIRMATION = instance_of(
    Confirmation, "a confirmation (evoros.certificate.confirmation.Confirmation)"
)
