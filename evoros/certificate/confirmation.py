"""Confirmation of each generation's best designs in another simulator or with other software."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import COUNT, SCORE, Rule, ask, checked, instance_of, is_whole
from evoros.controller.protocol import A_CONTROLLER, Controller, LiveController
from evoros.simulator.protocol import A_SIMULATOR, Simulator

Confirm = Callable[[list[int]], Mapping[int, float]]  # fitness by design


@dataclass(frozen=True)
@checked
class Confirmation:
    """Repeats the missions of each generation's best new designs in ``simulator``.

    The confirmed fitness replaces the original one, so that a search cannot exploit simplifications
    of its simulator. Confirmations use ``controller``, for example the real robot's software, in
    place of the run's controller.
    """

    simulator: Annotated[Simulator, A_SIMULATOR]
    best: Annotated[int, COUNT] = 3  # number of best new designs to confirm in each generation
    controller: Annotated[Controller | LiveController | None, A_CONTROLLER] = None

    def confirm_best(self, screened: Mapping[int, float], confirm: Confirm) -> dict[int, float]:
        """Confirm designs until the ``best`` fittest are confirmed; return their fitness by id.

        ``screened`` is the fitness of all new designs in the run's simulator; ``confirm`` returns
        the fitness of given designs in the confirming simulator. Designs are ranked by confirmed
        fitness, or by screened fitness if they are unconfirmed. Ties keep the order of
        ``screened``.
        """
        confirmed: dict[int, float] = {}
        while True:
            fitness = {**screened, **confirmed}
            best = sorted(fitness, key=fitness.__getitem__, reverse=True)[: self.best]
            unconfirmed = [design_id for design_id in best if design_id not in confirmed]
            if not unconfirmed:
                return confirmed
            confirmed.update(confirm(unconfirmed))


def confirm_best(
    confirmation: Confirmation, screened: Mapping[int, float], confirm: Confirm
) -> Mapping[int, float]:
    """Return the fitness of the confirmed designs."""

    def is_fitness(value: object) -> bool:
        if not isinstance(value, Mapping) or not screened.keys() >= value.keys():
            return False
        return all(map(is_whole, value)) and all(map(SCORE.holds, value.values()))

    rule = Rule("a mapping from ids of the screened designs to numbers", is_fitness)
    method = confirmation.confirm_best
    confirmed: Mapping[int, float] = ask("confirmation", method, rule, screened, confirm)
    return confirmed


A_CONFIRMATION = instance_of(
    Confirmation, "a confirmation (evoros.certificate.confirmation.Confirmation)"
)
